"""Input of judges, declaration of judges, and combination of trial outcomes into one result.

The module of a criterion's family decides whether a trial passes.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from fractions import Fraction
from typing import Any, TypeVar

from responders.function_calls import CallResult, CallResults
from service.grading.grade import CriterionResult, Evidence, PoolValue, TrialResult, VisibleFeedback
from service.grading.judging.marks import combine_outcomes, compute_marks, round_to_steps
from service.grading.judging.message_parts import add_hidden_note, add_place, describe_early_end, describe_place
from service.grading.judging.outcome import Outcome
from service.grading.judging.source_answers import SourceAnswers
from service.grading.pools.pool_sentences import describe_for_staff, describe_for_students
from service.grading.pools.pool_values import ERROR_OF_GRADE, compute_pool_share
from sim.sentences import Sentence, join_sentences
from submissions.assignment.definition import Assignment
from submissions.criteria import Criterion
from submissions.magics import Flags
from submissions.submission import Part

C = TypeVar("C", bound=Criterion)
#: Trials with their indices in the grade.
IndexedTrials = Sequence[tuple[int, TrialResult]]
#: Makes the message for all trials, or for the visible ones.
SummaryWriter = Callable[[IndexedTrials, Sequence[Outcome]], str]


@dataclass(frozen=True, slots=True)
class StaticAnalysis:
    """Analysis results. ``answers`` and ``called`` are by criterion id, ``checks`` by criterion id and trial index."""

    answers: Mapping[str, SourceAnswers] = field(default_factory=dict)
    flags: Flags = field(default_factory=Flags)
    called: Mapping[str, CallResults] = field(default_factory=dict)
    checks: Mapping[tuple[str, int], CallResult] = field(default_factory=dict)
    sandbox: str = ""
    missing: Part | None = None  # required, but not submitted


@dataclass(frozen=True, slots=True)
class Case:
    """The input of a judge: one submission. ``results`` are those of the criteria judged before, by id."""

    assignment: Assignment
    trials: Sequence[TrialResult]
    analysis: StaticAnalysis
    results: Mapping[str, CriterionResult]

    def list_trials(self, criterion: Criterion) -> IndexedTrials:
        """Return the trials of the criterion's scenarios, as recorded by the robot that it checks."""
        return [
            (index, use_robot_recording(criterion.robot, trial))
            for index, trial in enumerate(self.trials)
            if not criterion.scenarios or trial.scenario in criterion.scenarios
        ]


def has_hidden(trials: IndexedTrials) -> bool:
    """Return whether any of the trials is hidden from students."""
    return any(trial.visibility != "visible" for _, trial in trials)


def use_robot_recording(robot: int, trial: TrialResult) -> TrialResult:
    """Return the trial with the recording of that robot; of the first, if there is only one."""
    partner = trial.recording.partner
    return trial if robot == 1 or partner is None else replace(trial, recording=partner)


@dataclass(frozen=True, slots=True)
class Judge:
    """The judge of one schema."""

    schema: type[Criterion]
    judge: Callable[[Any, Case], CriterionResult]


def declare_judge(schema: type[C]) -> Callable[[Callable[[C, TrialResult], Outcome]], Judge]:
    """Declare the judge of a schema that needs only one trial at a time."""

    def decorator(judge: Callable[[C, TrialResult], Outcome]) -> Judge:
        return Judge(
            schema, lambda criterion, case: judge_by_trial(criterion, case, lambda _, trial: judge(criterion, trial))
        )

    return decorator


def declare_case_judge(schema: type[C]) -> Callable[[Callable[[C, Case], CriterionResult]], Judge]:
    """Declare the judge of a schema that needs several trials, or none."""

    def decorator(judge: Callable[[C, Case], CriterionResult]) -> Judge:
        return Judge(schema, judge)

    return decorator


def summarise_trials(trials: IndexedTrials, outcomes: Sequence[Outcome]) -> str:
    """Return the number of trials that passed, and the message of the first that failed."""
    count = len(outcomes)
    passes = sum(outcome.passed for outcome in outcomes)
    if count and passes == count:
        return outcomes[0].message if count == 1 else Sentence("As expected in all %(count)s trials.", count=count)
    tally = (
        Sentence("%(passes)s of %(count)s trials went as expected.", passes=passes, count=count) if count != 1 else ""
    )
    for (_, trial), outcome in zip(trials, outcomes, strict=True):
        if not outcome.passed:
            located_message = add_place(describe_place(trial, outcome.t), outcome.message)
            return join_sentences(tally, located_message, describe_early_end(trial, outcome))
    return tally


def judge_by_trial(
    criterion: Criterion,
    case: Case,
    get_outcome: Callable[[int, TrialResult], Outcome],
    summarise: SummaryWriter = summarise_trials,
) -> CriterionResult:
    """Combine the outcomes of the trials into a result. ``get_outcome`` gets the trial's index in the grade."""
    trials = case.list_trials(criterion)
    outcomes = [get_outcome(index, trial) for index, trial in trials]
    share, pool_value = _compute_share(criterion, case, outcomes)
    message, shown = summarise(trials, outcomes), _build_visible_feedback(trials, outcomes, summarise)
    if pool_value is not None:
        public_value = describe_for_students(pool_value, criterion.over)
        pool_value = describe_for_staff(pool_value, criterion.over)
        message = join_sentences(message, pool_value.note)
        if shown is not None:
            shown = replace(shown, message=join_sentences(shown.message, public_value.note), pool=public_value)
    if has_hidden(trials) and not criterion.bands:
        share = round_to_steps(share)
    return CriterionResult(
        id=criterion.id,
        title=criterion.title,
        marks=compute_marks(criterion.marks, share),
        max_marks=criterion.marks,
        message=message,
        visibility=criterion.visibility,
        evidence=tuple(
            Evidence(index, outcome.passed, outcome.message, outcome.t, outcome.pose, outcome.measures)
            for (index, _), outcome in zip(trials, outcomes, strict=True)
        ),
        shown=shown,
        pool=pool_value,
        findings={
            index: outcome.findings for (index, _), outcome in zip(trials, outcomes, strict=True) if outcome.findings
        },
    )


def _compute_share(criterion: Criterion, case: Case, outcomes: Sequence[Outcome]) -> tuple[Fraction, PoolValue | None]:
    """Return the fraction of the marks, and the value over the pool if the criterion has one."""
    pool = case.assignment.find_pool(criterion)
    if pool is None:
        return combine_outcomes(outcomes, criterion.over), None
    error = ERROR_OF_GRADE / len(case.assignment.chance_criteria)
    return compute_pool_share(criterion, outcomes, pool.trials, error)


def judge_once(criterion: Criterion, outcome: Outcome) -> CriterionResult:
    """Return the result of a criterion that is judged once per submission, without trials as evidence."""
    share = Fraction(outcome.passed) if criterion.over == "all" else outcome.score
    return CriterionResult(
        id=criterion.id,
        title=criterion.title,
        marks=compute_marks(criterion.marks, share),
        max_marks=criterion.marks,
        message=outcome.message,
        visibility=criterion.visibility,
        for_staff=outcome.for_staff,
        findings={None: outcome.findings} if outcome.findings else {},
    )


def _build_visible_feedback(
    trials: IndexedTrials, outcomes: Sequence[Outcome], summarise: SummaryWriter
) -> VisibleFeedback | None:
    """Return the feedback for students if some trials are hidden; otherwise None."""
    indices = [place for place, (_, trial) in enumerate(trials) if trial.visibility == "visible"]
    if len(indices) == len(trials):
        return None
    message = summarise([trials[place] for place in indices], [outcomes[place] for place in indices]) if indices else ""
    return VisibleFeedback(add_hidden_note(message))
