"""Judging: from an assignment and what happened in its trials to one result a criterion.

How each kind is judged is in the module of the kind; here they are gathered, marked, and put into words.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from collections.abc import Sequence as SequenceOf
from fractions import Fraction
from types import MappingProxyType
from typing import Any

from service.grading.grade import CriterionResult, Evidence, Shown, TrialResult
from service.grading.judging.circuits import judge_circuits
from service.grading.judging.collecting import judge_collects
from service.grading.judging.drawing import judge_drawing
from service.grading.judging.ending import judge_finishes, judge_pose
from service.grading.judging.function_checks import checked, judge_functions
from service.grading.judging.line import judge_follows, judge_laps
from service.grading.judging.logged import judge_datalog, judge_image_log
from service.grading.judging.marks import earned, share_of
from service.grading.judging.motion import judge_displacement, judge_encounters, judge_excursions, judge_moves
from service.grading.judging.outcome import Outcome
from service.grading.judging.path import (
    judge_closest,
    judge_keeps_out,
    judge_stays_inside,
    judge_touches_nothing,
    judge_visits,
)
from service.grading.judging.recognition import judge_recognition
from service.grading.judging.replies import judge_replies
from service.grading.judging.reported import judge_reports
from service.grading.judging.sequences import judge_events, judge_word_sequence
from service.grading.judging.source_rules import judge_source
from service.grading.judging.spread import judge_spread, spread_words
from service.grading.judging.stopping import judge_stop_on
from service.grading.judging.texts import judge_messages, judge_prints, judge_says
from service.grading.judging.timing import judge_ranking, judge_timing
from service.grading.judging.trial_words import early_end, place_words, shown_words
from service.grading.static_analysis import StaticAnalysis
from sim.errors import HostError
from sim.recording import Verdict
from submissions.assignment.definition import Assignment
from submissions.criteria import (
    Circuits,
    Classification,
    Closest,
    Collects,
    Criterion,
    Datalog,
    Displacement,
    Drawing,
    Encounters,
    EndPose,
    Events,
    Excursions,
    Finishes,
    Follows,
    Functions,
    ImageLog,
    KeepsOut,
    Laps,
    Messages,
    Moves,
    Prints,
    PythonCheck,
    Ranking,
    Replies,
    Reports,
    Robustness,
    Says,
    Sequence,
    SourceRules,
    Spread,
    StaysInside,
    StopOn,
    Timing,
    TouchesNothing,
    Visits,
)

#: How each kind of criterion is judged in one trial; classification, which pools its trials, is apart.
_JUDGES: Mapping[type, Callable[[Any, TrialResult], Outcome]] = MappingProxyType(
    {
        Finishes: judge_finishes,
        Prints: judge_prints,
        Says: judge_says,
        Messages: judge_messages,
        Replies: judge_replies,
        EndPose: judge_pose,
        Collects: judge_collects,
        StopOn: judge_stop_on,
        Sequence: judge_word_sequence,
        Events: judge_events,
        Datalog: judge_datalog,
        ImageLog: judge_image_log,
        Timing: judge_timing,
        Displacement: judge_displacement,
        Moves: judge_moves,
        Excursions: judge_excursions,
        Encounters: judge_encounters,
        Drawing: judge_drawing,
        Visits: judge_visits,
        StaysInside: judge_stays_inside,
        KeepsOut: judge_keeps_out,
        TouchesNothing: judge_touches_nothing,
        Closest: judge_closest,
        Circuits: judge_circuits,
        Follows: judge_follows,
        Laps: judge_laps,
        Spread: judge_spread,
        Reports: judge_reports,
    }
)

_NOTHING_FOUND = StaticAnalysis()

_Indexed = SequenceOf[tuple[int, TrialResult]]


def judge(
    assignment: Assignment, trials: tuple[TrialResult, ...], analysis: StaticAnalysis = _NOTHING_FOUND
) -> tuple[CriterionResult, ...]:
    """One result for each criterion of the assignment, in its order.

    ``analysis`` is what is known of the submission beside the recordings. A trial that was cut short is judged by
    what was reached. Raises HostError for a trial that this machine spoilt, because such a trial must be run
    again, not marked, and AssignmentError where a check of the instructor's failed.
    """
    refuse_spoilt(trials)
    results: dict[str, CriterionResult] = {}
    for criterion in in_turn(assignment):
        results[criterion.id] = judge_one(criterion, assignment, trials, analysis, results)
    return tuple(results[criterion.id] for criterion in assignment.criteria)


def refuse_spoilt(trials: SequenceOf[TrialResult]) -> None:
    """Raises HostError for a trial that this machine spoilt."""
    if any(trial.verdict is Verdict.HOST_ERROR for trial in trials):
        raise HostError("A trial that failed on this machine cannot be marked; it has to be run again.")


def in_turn(assignment: Assignment) -> list[Criterion]:
    """The criteria as they are judged: ranks, which are given for figures that others measure, come last."""
    return sorted(assignment.criteria, key=lambda each: isinstance(each, Ranking))


def judge_one(
    criterion: Criterion,
    assignment: Assignment,
    trials: SequenceOf[TrialResult],
    analysis: StaticAnalysis,
    results: Mapping[str, CriterionResult],
) -> CriterionResult:
    """The result of one criterion; ``results`` are those of the criteria before it in turn, by id."""
    if isinstance(criterion, SourceRules | Functions):
        return _judged_once(criterion, analysis, trials)
    own = [
        (index, trial)
        for index, trial in enumerate(trials)
        if not criterion.scenarios or trial.scenario in criterion.scenarios
    ]
    if isinstance(criterion, Classification | Robustness):
        return judge_recognition(criterion, assignment, own)
    outcomes = [_outcome(criterion, place, trial, analysis, results) for place, trial in own]
    return CriterionResult(
        id=criterion.id,
        title=criterion.title,
        marks=earned(criterion.marks, share_of(outcomes, criterion.over)),
        max_marks=criterion.marks,
        message=_told(criterion, own, outcomes),
        visibility=criterion.visibility,
        evidence=tuple(
            Evidence(index, outcome.passed, outcome.message, outcome.t, outcome.pose, outcome.measures)
            for (index, _), outcome in zip(own, outcomes, strict=True)
        ),
        shown=_shown(criterion, own, outcomes),
    )


def _judged_once(
    criterion: SourceRules | Functions, analysis: StaticAnalysis, trials: SequenceOf[TrialResult]
) -> CriterionResult:
    """For what is looked at once a submission: no trial is its evidence."""
    if isinstance(criterion, SourceRules):
        driven = trials if criterion.part == "program" else ()
        outcome = judge_source(criterion, analysis.answers.get(criterion.id), analysis.flags, driven)
    else:
        outcome = judge_functions(criterion, analysis.called.get(criterion.id))
    share = Fraction(outcome.passed) if criterion.over == "all" else outcome.score
    return CriterionResult(
        id=criterion.id,
        title=criterion.title,
        marks=earned(criterion.marks, share),
        max_marks=criterion.marks,
        message=outcome.message,
        visibility=criterion.visibility,
        for_staff=outcome.for_staff,
    )


def _outcome(
    criterion: Criterion,
    place: int,
    trial: TrialResult,
    analysis: StaticAnalysis,
    results: Mapping[str, CriterionResult],
) -> Outcome:
    if isinstance(criterion, PythonCheck):
        return checked(criterion, analysis.checks[criterion.id, place])
    if isinstance(criterion, Ranking):
        return judge_ranking(criterion, place, results.get(criterion.of))
    return _JUDGES[type(criterion)](criterion, trial)


def _told(criterion: Criterion, trials: _Indexed, outcomes: SequenceOf[Outcome]) -> str:
    """The summary; of an observation all that was observed."""
    if isinstance(criterion, Spread) and trials and all(outcome.passed for outcome in outcomes):
        return spread_words(criterion, [trial for _, trial in trials])
    return _summary(trials, outcomes)


def _shown(criterion: Criterion, trials: _Indexed, outcomes: SequenceOf[Outcome]) -> Shown | None:
    """What a student may read where some trials are hidden."""
    places = [place for place, (_, trial) in enumerate(trials) if trial.visibility == "visible"]
    if len(places) == len(trials):
        return None
    told = _told(criterion, [trials[place] for place in places], [outcomes[place] for place in places])
    return Shown(shown_words(told if places else ""))


def _summary(trials: _Indexed, outcomes: SequenceOf[Outcome]) -> str:
    """How many trials went well, and what happened in the first that did not."""
    count = len(outcomes)
    passes = sum(outcome.passed for outcome in outcomes)
    if count and passes == count:
        return outcomes[0].message if count == 1 else f"As expected in all {count} trials."
    tally = f"{passes} of {count} trials went as expected. " if count != 1 else ""
    for (_, trial), outcome in zip(trials, outcomes, strict=True):
        if not outcome.passed:
            return f"{tally}{place_words(trial, outcome.t)}: {outcome.message}{early_end(trial, outcome)}"
    return tally.strip()
