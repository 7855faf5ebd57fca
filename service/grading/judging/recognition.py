"""From what a recognition criterion found to its result: marks, curves, and the sentences that are read.

Finding answers and truths is ``classification.py``'s, the curves ``sweeps.py``'s.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from fractions import Fraction

from service.grading.grade import AccuracyCurve, Counts, CriterionResult, Shown, TrialResult
from service.grading.judging.classification import Classified, classify, told
from service.grading.judging.marks import earned, share_of_accuracy, share_of_steps
from service.grading.judging.samples import Sample
from service.grading.judging.sweeps import area, curve_along, curves_of, levels_along, range_above, share_of_robustness
from service.grading.judging.trial_words import early_end, place_words, shown_words
from submissions.assignment.definition import Assignment
from submissions.criteria.classification import Classification, Recognition, Robustness
from submissions.sweep import CONDITIONS

_MOST_LEVELS_TOLD = 12


def judge_recognition(
    criterion: Classification | Robustness, assignment: Assignment, trials: Sequence[tuple[int, TrialResult]]
) -> CriterionResult:
    """The result of a criterion that pools its ``trials`` (with their indices in the grade)."""
    result = _judged(criterion, assignment, trials)
    visible = [(index, trial) for index, trial in trials if trial.visibility == "visible"]
    if len(visible) == len(trials):
        return result
    if not visible:
        return replace(result, shown=Shown(shown_words("")))
    alone = _judged(criterion, assignment, visible)
    return replace(result, shown=Shown(shown_words(alone.message), alone.accuracy, alone.curves))


def _judged(
    criterion: Classification | Robustness, assignment: Assignment, trials: Sequence[tuple[int, TrialResult]]
) -> CriterionResult:
    if isinstance(criterion, Robustness):
        levels = levels_along(criterion.along, dict(trials))
        trials = [(index, trial) for index, trial in trials if index in levels]
    found = classify(criterion, assignment, trials)
    by_index = dict(trials)
    curves = curves_of(found.samples, by_index)
    if isinstance(criterion, Robustness):
        curve = curve_along(criterion.along, found.samples, by_index)
        share = share_of_robustness(criterion, curve)
        curves = (replace(curve, asked=criterion.level), *(other for other in curves if other.along != criterion.along))
        words = _robustness_words(criterion, curve)
    else:
        share = _share(criterion, found)
        words = _what_marks_need(criterion, found) if share < 1 else ""
    return CriterionResult(
        id=criterion.id,
        title=criterion.title,
        marks=earned(criterion.marks, share),
        max_marks=criterion.marks,
        message=_tally(criterion, found) + words + _first_wrong(found.samples, by_index),
        visibility=criterion.visibility,
        evidence=found.evidence,
        accuracy=found.accuracy,
        predictions=found.predictions,
        curves=curves,
    )


def counts_words(counts: Counts) -> str:
    """``9 images sent: 7 answered, 1 late, 0 malformed, 1 unanswered; 2 duplicate answers``."""
    return (
        f"{counts.sent} images sent: {counts.answered} answered, {counts.late} late, {counts.malformed} malformed, "
        f"{counts.unanswered} unanswered; {counts.duplicates} duplicate answers"
    )


def _share(criterion: Classification, found: Classified) -> Fraction:
    right, count = _right(found), found.accuracy.n
    if criterion.steps:
        return share_of_steps(right, count, criterion.steps, criterion.marks)
    return share_of_accuracy(right, count, criterion.at_least, criterion.over)


def _right(found: Classified) -> int:
    return sum(sample.right for sample in found.samples)


def _tally(criterion: Recognition, found: Classified) -> str:
    accuracy = found.accuracy
    what = "images" if criterion.each_pattern is None else "patterns"
    words = (
        f"{_right(found)} of {accuracy.n} {what} named rightly: accuracy {accuracy.value:.2f} "
        f"(95 % interval {accuracy.low:.2f} to {accuracy.high:.2f})."
    )
    counts = accuracy.counts
    if counts is not None and (counts.answered != counts.sent or counts.duplicates):
        words += f" {counts_words(counts)}."
    confidence = accuracy.confidence
    if confidence is not None:
        sure = [
            f"{mean:.2f} when {how} ({count})"
            for mean, count, how in (
                (confidence.right, confidence.n_right, "right"),
                (confidence.wrong, confidence.n_wrong, "wrong"),
            )
            if mean is not None
        ]
        words += f" Mean confidence {' and '.join(sure)}."
    return words


def _what_marks_need(criterion: Classification, found: Classified) -> str:
    if criterion.at_least is not None:
        return f" All marks are given from {criterion.at_least:g} on."
    if criterion.steps:
        return " Marks: " + ", ".join(f"{marks:g} from {accuracy:g} on" for accuracy, marks in criterion.steps) + "."
    return ""


def _robustness_words(criterion: Robustness, curve: AccuracyCurve) -> str:
    about = CONDITIONS[criterion.along]
    levels = curve.levels
    if not levels:
        return f" No trial was swept over {about.words}."
    each = ", ".join(f"{level.value:.2f} at {level.at:g}" for level in levels[:_MOST_LEVELS_TOLD])
    more = ", ..." if len(levels) > _MOST_LEVELS_TOLD else ""
    words = f" By {about.words} ({about.unit}): {each}{more}."
    if criterion.level is None:
        return f"{words} Mean over the sweep: {float(area(levels)):.2f}."
    held = range_above(levels, criterion.level)
    if held is None:
        return f"{words} It is below {criterion.level:g} at the easiest level already."
    where = f"only at {held[0].at:g}" if held[0].at == held[1].at else f"from {held[0].at:g} to {held[1].at:g}"
    return f"{words} It is at least {criterion.level:g} {where} {about.unit}."


def _first_wrong(samples: Sequence[Sample], trials: dict[int, TrialResult]) -> str:
    """Where the first image was named wrongly."""
    first = next((sample for sample in samples if not sample.right), None)
    if first is None:
        return ""
    trial = trials[first.trial]
    return f" {place_words(trial, first.image.t if first.image else None)}: {told(first)}{early_end(trial)}"
