"""The outcome of one criterion in one trial: the fault that ended a program, the penalty for stray output, the value.

The modules of the families decide who passes. Marks are exact fractions until they are rounded once at the end.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from decimal import ROUND_HALF_UP, Decimal
from fractions import Fraction
from typing import TYPE_CHECKING, Literal

from service.grading.findings import Finding, StrayItems
from service.grading.grade import Measure
from sim.recording import Fault, Pose, Recording, Verdict
from sim.sentences import Sentence, join_sentences

if TYPE_CHECKING:
    from submissions.criteria.common import CriterionWithStrays

_MAX_FAILED_SCORE = Fraction(99, 100)
Over = Literal["share", "all", "mean", "median", "worst"]

_CENT = Decimal("0.01")
_STEPS = 20
#: This many irrelevant items weigh as much as one required item in a wrong place.
_OTHERS_PER_ITEM = 20


@dataclass(frozen=True, slots=True)
class Outcome:
    """The outcome of one criterion in one trial. ``score`` is the fraction reached, and 1 exactly if it passed."""

    passed: bool
    score: Fraction
    message: str
    t: float | None = None
    pose: Pose | None = None
    measures: tuple[Measure, ...] = ()
    for_staff: str = ""  # what staff should check; not shown to students
    has_end_reason: bool = False  # the message already says why the run ended early
    findings: tuple[Finding, ...] = ()


def pass_with(
    message: str,
    t: float | None = None,
    pose: Pose | None = None,
    measures: tuple[Measure, ...] = (),
    for_staff: str = "",
) -> Outcome:
    """Return an outcome with full score."""
    return Outcome(True, Fraction(1), message, t, pose, measures, for_staff)


def fail_with(
    message: str,
    t: float | None = None,
    pose: Pose | None = None,
    score: Fraction = Fraction(0),
    measures: tuple[Measure, ...] = (),
    for_staff: str = "",
    findings: tuple[Finding, ...] = (),
) -> Outcome:
    """Return a failed outcome. ``score`` is kept below 1, because all may be present but in the wrong order."""
    failed_score = min(max(score, Fraction(0)), _MAX_FAILED_SCORE)
    return Outcome(False, failed_score, message, t, pose, measures, for_staff, findings=findings)


def find_ending_fault(recording: Recording) -> Fault | None:
    """Return the fault that kept the program from ending by itself, or None.

    Errors of a responder don't count, because the program continues after them.
    """
    for fault in recording.faults:
        if fault.who != "responder" and fault.verdict is not Verdict.PROTOCOL_ERROR:
            return fault
    if recording.verdict in (Verdict.FINISHED, Verdict.RESPONDER_ERROR, Verdict.PROTOCOL_ERROR) or recording.faults:
        return None
    return Fault(recording.end_t, recording.verdict, "program", str(recording.verdict).replace("_", " "))


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


@dataclass(frozen=True, slots=True)
class Strays:
    """Stray items: output that was not required. ``words`` is a clause that describes it."""

    words: str
    misplaced: int = 0  # required items in a wrong place
    others: int = 0  # items of the same kind that are not required

    @property
    def weight(self) -> Fraction:
        """The weight, as a number of required items."""
        return self.misplaced + Fraction(self.others, _OTHERS_PER_ITEM)


def apply_stray_penalty(outcome: Outcome, criterion: CriterionWithStrays, count: int, strays: Strays) -> Outcome:
    """Reduce the outcome for ``count`` items: strays beyond the allowed number count like additional missing items."""
    excess = strays.weight - (count if criterion.strays is None else criterion.strays)
    if excess <= 0:
        return outcome
    return fail_with(
        join_sentences(
            outcome.message,
            Sentence(
                "Also, %(strays)s. This costs marks. Give only the required answers, not every possible one.",
                strays=strays.words,
            ),
        ),
        outcome.t,
        outcome.pose,
        outcome.score * count / (count + excess),
        outcome.measures,
        outcome.for_staff,
        (*outcome.findings, StrayItems(strays.misplaced + strays.others, outcome.passed)),
    )
