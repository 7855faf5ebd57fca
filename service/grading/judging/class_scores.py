"""Precision and recall of each class, from the confusion matrix.

They are derived from an ``Accuracy`` and never stored, so the two cannot disagree.
"""

from __future__ import annotations

from dataclasses import dataclass

from service.grading.grade import Accuracy


@dataclass(frozen=True, slots=True)
class ClassScore:
    """One class: how many images showed it, how often it was answered, and how often both.

    ``precision`` is right / answered and ``recall`` right / shown; None if the divisor is 0.
    """

    label: str
    shown: int
    answered: int
    right: int

    @property
    def precision(self) -> float | None:
        """The fraction of the images identified as this class that show it, 0 to 1."""
        return self.right / self.answered if self.answered else None

    @property
    def recall(self) -> float | None:
        """The fraction of the images of this class that were identified correctly, 0 to 1."""
        return self.right / self.shown if self.shown else None


def compute_class_scores(accuracy: Accuracy) -> tuple[ClassScore, ...]:
    """Return a score for every label, in order; empty if the counts are withheld."""
    if not accuracy.confusion:
        return ()
    return tuple(
        ClassScore(
            label,
            sum(count for truth, _, count in accuracy.confusion if truth == label),
            sum(count for _, answer, count in accuracy.confusion if answer == label),
            sum(count for truth, answer, count in accuracy.confusion if truth == answer == label),
        )
        for label in accuracy.labels
    )
