"""Marks of a criterion from its outcomes: exact fractions, which are rounded once at the end.

``outcome.py`` defines the outcome of a trial.
"""

from __future__ import annotations

from collections.abc import Sequence
from decimal import ROUND_HALF_UP, Decimal
from fractions import Fraction
from typing import Literal

from service.grading.judging.outcome import Outcome

Over = Literal["share", "all", "mean", "median", "worst"]

_CENT = Decimal("0.01")
_STEPS = 20


def compute_marks(marks: Decimal, share: Fraction) -> Decimal:
    """Return ``share`` (0 to 1) of ``marks``, rounded half up to two places, at most ``marks``."""
    exact_marks = Fraction(marks) * min(max(share, Fraction(0)), Fraction(1))
    # Scaled to whole cents first, so that no decimal expansion is truncated before rounding.
    cents = exact_marks * 100
    whole_cents = (2 * cents.numerator + cents.denominator) // (2 * cents.denominator)
    return min(Decimal(whole_cents).scaleb(-2), marks).quantize(_CENT, rounding=ROUND_HALF_UP)


def combine_outcomes(outcomes: Sequence[Outcome], rule: Over) -> Fraction:
    """Return the fraction of a criterion's marks for these trials, by the rule ``rule``; 0 without trials."""
    if not outcomes:
        return Fraction(0)
    passes = sum(outcome.passed for outcome in outcomes)
    scores = sorted(outcome.score for outcome in outcomes)
    count = len(scores)
    match rule:
        case "share":
            return Fraction(passes, count)
        case "all":
            return Fraction(passes == count)
        case "mean":
            return sum(scores, Fraction(0)) / count
        case "median":
            return (scores[(count - 1) // 2] + scores[count // 2]) / 2
        case "worst":
            return scores[0]


def round_to_steps(share: Fraction) -> Fraction:
    """Round ``share`` to steps of 5 %; a value below 1 stays below 1.

    Used for hidden trials, so that marks don't reveal what a program counted there.
    """
    if share >= 1:
        return share
    return min(Fraction((2 * share * _STEPS + 1) // 2, _STEPS), Fraction(_STEPS - 1, _STEPS))


def compute_accuracy_share(correct_count: int, count: int, at_least: float | None, rule: Over) -> Fraction:
    """Return the fraction of a classification's marks for ``correct_count`` of ``count`` answers.

    Full marks from ``at_least`` on (all correct if None). Below it, nothing with ``all``, otherwise in proportion.
    """
    if not count:
        return Fraction(0)
    accuracy = Fraction(correct_count, count)
    # Convert the decimal that the instructor wrote, not its nearest binary fraction: 9 of 10 is at least 0.9.
    required_accuracy = Fraction(1) if at_least is None else Fraction(str(at_least))
    if accuracy >= required_accuracy:
        return Fraction(1)
    return Fraction(0) if rule == "all" else accuracy / required_accuracy


def compute_steps_share(
    correct_count: int, count: int, steps: Sequence[tuple[float, float]], marks: Decimal
) -> Fraction:
    """Return the fraction of ``marks`` for the last step that the accuracy reaches.

    ``steps`` are pairs (accuracy, marks). The accuracy is ``correct_count`` of ``count``.
    """
    if not count or not marks:
        return Fraction(0)
    reached_marks = [worth for accuracy, worth in steps if Fraction(correct_count, count) >= Fraction(str(accuracy))]
    return Fraction(str(reached_marks[-1])) / Fraction(marks) if reached_marks else Fraction(0)
