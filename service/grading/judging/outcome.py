"""The outcome of one criterion in one trial: the fault that ended a program, and the penalty for stray output.

The modules of the families decide who passes.
"""

from __future__ import annotations

from dataclasses import dataclass
from fractions import Fraction
from typing import TYPE_CHECKING

from service.grading.findings import Finding, StrayItems
from service.grading.grade import Measure
from service.language import translatable
from sim.recording import Fault, Pose, Recording, Verdict
from sim.sentences import Sentence, join_sentences

if TYPE_CHECKING:
    from submissions.criteria.common import CriterionWithStrays

_MAX_FAILED_SCORE = Fraction(99, 100)
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


@dataclass(frozen=True, slots=True)
class Strays:
    """Stray items: output that was not required. ``words`` is a clause that describes it."""

    words: str
    misplaced: int = 0  # required items in a wrong place
    others: int = 0  # items of the same kind that are not required
    advice: str = translatable("Give only the required answers, not every possible one.")

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
            Sentence("Also, %(strays)s. This costs marks.", strays=strays.words),
            Sentence(strays.advice),
        ),
        outcome.t,
        outcome.pose,
        outcome.score * count / (count + excess),
        outcome.measures,
        outcome.for_staff,
        (*outcome.findings, StrayItems(strays.misplaced + strays.others, outcome.passed)),
    )
