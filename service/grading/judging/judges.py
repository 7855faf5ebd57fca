"""How the judge of a criterion is declared, and how the outcomes of its trials become the criterion's one result.

Whether a trial passes is decided in the module of the family, which is named like the schema's.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from fractions import Fraction
from typing import Any, TypeVar

from service.grading.grade import CriterionResult, Evidence, Shown, TrialResult
from service.grading.judging.case import Case, Indexed, has_hidden
from service.grading.judging.marks import earned, in_steps, share_of
from service.grading.judging.message_parts import early_end, place_words, shown_words
from service.grading.judging.outcome import Outcome
from submissions.criteria import Criterion

C = TypeVar("C", bound=Criterion)
#: What is said of all trials, or of those that are shown.
Summary = Callable[[Indexed, Sequence[Outcome]], str]


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
