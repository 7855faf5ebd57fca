"""Who may see what of a grade: the part that a student is shown, and the trial that is worth a closer look.

It hides, it never re-marks: what is left keeps the marks and messages it had.
"""

from __future__ import annotations

from dataclasses import replace
from decimal import Decimal

from service.grading.grade import CriterionResult, Grade, Shown, TrialResult
from service.grading.judging.words import shown_words
from sim.recording import Verdict

#: What a student sees before anything is published.
BEFORE_PUBLICATION = frozenset({"visible"})


def student_view(grade: Grade, released: frozenset[str] = BEFORE_PUBLICATION) -> Grade:
    """``grade`` without what is for staff, what it cost, and what has a visibility that is not in ``released``.

    Evidence and images from hidden trials go too; of a criterion that loses trials the message, the accuracy and
    the curves are those of the visible trials alone. So nothing is left of hidden trials but the marks. Totals are
    then those of the criteria shown.
    """
    kept = [index for index, trial in enumerate(grade.trials) if trial.visibility in released]
    new_index = {old: new for new, old in enumerate(kept)}
    return replace(
        grade,
        criteria=tuple(
            replace(_without_hidden_trials(result, new_index), for_staff="", unjudged="")
            for result in grade.criteria
            if result.visibility in released
        ),
        trials=tuple(grade.trials[index] for index in kept),
        cost=grade.cost and replace(grade.cost, spent=None),
    )


def worst_trial(grade: Grade, scenario: str) -> int:
    """Index, in ``grade.trials``, of the scenario's trial that lost most; the first of equals.

    A trial loses the marks of every criterion it failed; of those equal in that, one that ended in a fault is
    worse than one that ran out of time, and that is worse than one that finished.
    """
    lost = [Decimal(0)] * len(grade.trials)
    for result in grade.criteria:
        for evidence in result.evidence:
            if not evidence.passed and 0 <= evidence.trial < len(lost):
                lost[evidence.trial] += result.max_marks
    candidates = [index for index, trial in enumerate(grade.trials) if trial.scenario == scenario]
    return max(candidates, key=lambda index: (lost[index], _severity(grade.trials[index]), -index))


def scenarios(grade: Grade) -> tuple[str, ...]:
    """The scenarios of the grade's trials, in the order they were run."""
    return tuple(dict.fromkeys(trial.scenario for trial in grade.trials))


def _severity(trial: TrialResult) -> int:
    if trial.verdict is Verdict.FINISHED:
        return 0
    return 1 if trial.verdict is Verdict.TIME_LIMIT else 2


def _without_hidden_trials(result: CriterionResult, new_index: dict[int, int]) -> CriterionResult:
    evidence = tuple(replace(item, trial=new_index[item.trial]) for item in result.evidence if item.trial in new_index)
    predictions = tuple(
        replace(prediction, trial=new_index[prediction.trial])
        for prediction in result.predictions
        if prediction.trial in new_index
    )
    kept = replace(result, evidence=evidence, predictions=predictions)
    if len(evidence) == len(result.evidence):
        return replace(kept, shown=None)
    # A grade of before this was kept apart tells nothing.
    shown = result.shown or Shown(shown_words(""))
    return replace(kept, message=shown.message, accuracy=shown.accuracy, curves=shown.curves, shown=None)
