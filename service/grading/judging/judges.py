"""What a judge is given, how the judge of a criterion is declared, and how outcomes of trials become one result.

Whether a trial passes is decided in the module of the family, which is named like the schema's.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from fractions import Fraction
from typing import Any, TypeVar

from responders.function_calls import Called, Returned
from service.grading.grade import CriterionResult, Evidence, Shown, TrialResult
from service.grading.judging.message_parts import early_end, place_words, shown_words
from service.grading.judging.outcome import Outcome, earned, in_steps, share_of
from service.grading.judging.source_answers import SourceAnswers
from submissions.assignment.definition import Assignment
from submissions.criteria import Criterion
from submissions.magics import Flags
from submissions.submission import Part

C = TypeVar("C", bound=Criterion)
#: Trials with their indices in the grade.
Indexed = Sequence[tuple[int, TrialResult]]
#: What is said of all trials, or of those that are shown.
Summary = Callable[[Indexed, Sequence[Outcome]], str]


@dataclass(frozen=True, slots=True)
class StaticAnalysis:
    """``answers`` and ``called`` are by the id of a criterion, ``checks`` by that and the place of the trial."""

    answers: Mapping[str, SourceAnswers] = field(default_factory=dict)
    flags: Flags = field(default_factory=Flags)
    called: Mapping[str, Called] = field(default_factory=dict)
    checks: Mapping[tuple[str, int], Returned] = field(default_factory=dict)
    sandbox: str = ""
    missing: Part | None = None  # asked for, and not submitted


@dataclass(frozen=True, slots=True)
class Case:
    """One submission before its judges; ``results`` are those of the criteria before this one in turn, by id."""

    assignment: Assignment
    trials: Sequence[TrialResult]
    analysis: StaticAnalysis
    results: Mapping[str, CriterionResult]

    def looked_at_by(self, criterion: Criterion) -> Indexed:
        """The trials of the criterion's scenarios, as the robot had them that it looks at."""
        return [
            (index, as_had_by(criterion.robot, trial))
            for index, trial in enumerate(self.trials)
            if not criterion.scenarios or trial.scenario in criterion.scenarios
        ]


def has_hidden(trials: Indexed) -> bool:
    """Whether any of the trials is not shown to students at once."""
    return any(trial.visibility != "visible" for _, trial in trials)


def as_had_by(robot: int, trial: TrialResult) -> TrialResult:
    """The trial with the recording of that robot; of the first, where there is one."""
    partner = trial.recording.partner
    return trial if robot == 1 or partner is None else replace(trial, recording=partner)


@dataclass(frozen=True, slots=True)
class Judge:
    """Who judges the criteria of one schema."""

    schema: type[Criterion]
    judge: Callable[[Any, Case], CriterionResult]


def judges(schema: type[C]) -> Callable[[Callable[[C, TrialResult], Outcome]], Judge]:
    """Declares the judge of a schema that looks at one trial at a time and needs nothing else."""

    def declared(judge: Callable[[C, TrialResult], Outcome]) -> Judge:
        return Judge(
            schema, lambda criterion, case: by_trial(criterion, case, lambda _, trial: judge(criterion, trial))
        )

    return declared


def judges_case(schema: type[C]) -> Callable[[Callable[[C, Case], CriterionResult]], Judge]:
    """Declares the judge of a schema that needs more than one trial to see, or none."""

    def declared(judge: Callable[[C, Case], CriterionResult]) -> Judge:
        return Judge(schema, judge)

    return declared


def summary(trials: Indexed, outcomes: Sequence[Outcome]) -> str:
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


def by_trial(
    criterion: Criterion, case: Case, outcome_of: Callable[[int, TrialResult], Outcome], told: Summary = summary
) -> CriterionResult:
    """The result from the outcome of each trial, which is asked for by its index in the grade."""
    trials = case.looked_at_by(criterion)
    outcomes = [outcome_of(index, trial) for index, trial in trials]
    share = share_of(outcomes, criterion.over)
    return CriterionResult(
        id=criterion.id,
        title=criterion.title,
        marks=earned(criterion.marks, in_steps(share) if has_hidden(trials) else share),
        max_marks=criterion.marks,
        message=told(trials, outcomes),
        visibility=criterion.visibility,
        evidence=tuple(
            Evidence(index, outcome.passed, outcome.message, outcome.t, outcome.pose, outcome.measures)
            for (index, _), outcome in zip(trials, outcomes, strict=True)
        ),
        shown=_shown(trials, outcomes, told),
    )


def once(criterion: Criterion, outcome: Outcome) -> CriterionResult:
    """The result of what is looked at once a submission: no trial is its evidence."""
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


def _shown(trials: Indexed, outcomes: Sequence[Outcome], told: Summary) -> Shown | None:
    """What a student may read where some trials are hidden."""
    places = [place for place, (_, trial) in enumerate(trials) if trial.visibility == "visible"]
    if len(places) == len(trials):
        return None
    words = told([trials[place] for place in places], [outcomes[place] for place in places]) if places else ""
    return Shown(shown_words(words))
