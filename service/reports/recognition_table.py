"""What a report tells of recognition in figures: what became of the images, and each class's precision and recall.

Plain texts for a template; everything was counted when the work was marked.
"""

from __future__ import annotations

from dataclasses import dataclass

from service.grading.grade import CriterionResult
from service.grading.judging.per_class import class_scores
from service.reports.readable import one_line


@dataclass(frozen=True, slots=True)
class ClassLine:
    """One class: how many showed it, how many were called it, how many both, precision and recall."""

    label: str
    shown: int
    answered: int
    right: int
    precision: str
    recall: str


@dataclass(frozen=True, slots=True)
class RecognitionTable:
    """One criterion's figures. ``sums`` is a sentence whose numbers add up."""

    title: str
    accuracy: str
    sums: str
    confidence: str
    classes: tuple[ClassLine, ...]


def recognition_table(result: CriterionResult) -> RecognitionTable:
    """The figures of a criterion that measured an accuracy."""
    accuracy = result.accuracy
    assert accuracy is not None
    of = accuracy.counts.of if accuracy.counts is not None else "images"
    return RecognitionTable(
        title=one_line(result.title, 200),
        accuracy=f"Accuracy {accuracy.value:.3f}, 95 % interval {accuracy.low:.3f} to {accuracy.high:.3f}, "
        f"n = {accuracy.n} {of}.",
        sums=_sums(result),
        confidence=_confidence(result),
        classes=tuple(
            ClassLine(
                one_line(score.label, 60),
                score.shown,
                score.answered,
                score.right,
                _share(score.precision),
                _share(score.recall),
            )
            for score in class_scores(accuracy)
            if score.shown or score.answered
        ),
    )


def _sums(result: CriterionResult) -> str:
    counts = result.accuracy.counts if result.accuracy is not None else None
    if counts is None:
        return ""
    missing = f", and {counts.missing} that were missing, each a wrong answer" if counts.missing else ""
    return (
        f"Images sent: {counts.sent} = {counts.answered} answered + {counts.late} late + {counts.malformed} "
        f"malformed + {counts.unanswered} unanswered; duplicate answers: {counts.duplicates}. "
        f"Counted: {counts.counted} {counts.of}{missing}."
    )


def _confidence(result: CriterionResult) -> str:
    found = result.accuracy.confidence if result.accuracy is not None else None
    if found is None:
        return ""
    means = [
        f"{mean:.2f} when {how} (n = {count})"
        for mean, count, how in ((found.right, found.n_right, "right"), (found.wrong, found.n_wrong, "wrong"))
        if mean is not None
    ]
    return f"Mean confidence {' and '.join(means)}."


def _share(value: float | None) -> str:
    return "\N{EN DASH}" if value is None else f"{value:.2f}"
