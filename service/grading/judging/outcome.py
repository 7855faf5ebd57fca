"""How one criterion fared in one trial, and what kept a program from ending by itself.

Plain data; who passes is decided in the modules of the families, what it is worth in ``marks.py``.
"""

from __future__ import annotations

from dataclasses import dataclass
from fractions import Fraction

from service.grading.grade import Measure
from sim.recording import Fault, Pose, Recording, Verdict

_SHORT_OF_ALL = Fraction(99, 100)


@dataclass(frozen=True, slots=True)
class Outcome:
    """``score`` is the part of what was asked that was reached, 0 to 1, and 1 exactly when it passed."""

    passed: bool
    score: Fraction
    message: str
    t: float | None = None
    pose: Pose | None = None
    measures: tuple[Measure, ...] = ()
    for_staff: str = ""  # where somebody should look, which no student is told


def passed(
    message: str,
    t: float | None = None,
    pose: Pose | None = None,
    measures: tuple[Measure, ...] = (),
    for_staff: str = "",
) -> Outcome:
    """An outcome with the whole score."""
    return Outcome(True, Fraction(1), message, t, pose, measures, for_staff)


def failed(
    message: str,
    t: float | None = None,
    pose: Pose | None = None,
    score: Fraction = Fraction(0),
    measures: tuple[Measure, ...] = (),
    for_staff: str = "",
) -> Outcome:
    """``score`` is kept below 1: everything may have been there, and yet in the wrong order."""
    return Outcome(False, min(max(score, Fraction(0)), _SHORT_OF_ALL), message, t, pose, measures, for_staff)


def cut(recording: Recording) -> Fault | None:
    """What kept the program from ending by itself, if something did.

    A responder that raises or breaks the protocol leaves the program running, so that is no cut.
    """
    for fault in recording.faults:
        if fault.who != "responder" and fault.verdict is not Verdict.PROTOCOL_ERROR:
            return fault
    if recording.verdict in (Verdict.FINISHED, Verdict.RESPONDER_ERROR, Verdict.PROTOCOL_ERROR) or recording.faults:
        return None
    return Fault(recording.end_t, recording.verdict, "program", str(recording.verdict).replace("_", " "))
