"""How one criterion fared in one trial, and what every kind of judging needs to say so.

Plain data and words; who passes is decided in the modules of the kinds, what it is worth in ``marks.py``.
"""

from __future__ import annotations

from dataclasses import dataclass
from fractions import Fraction

from service.grading.grade import Measure
from sim.recording import Fault, Pose, Recording, Verdict

_LONGEST_QUOTE = 80
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


def quoted(text: str) -> str:
    """A text of the student's in a sentence: one line, shortened."""
    line = " ".join(text.split())
    return f'"{line}"' if len(line) <= _LONGEST_QUOTE else f'"{line[: _LONGEST_QUOTE - 3]}..."'


def listed(texts: tuple[str, ...], word: str = "and") -> str:
    """``"a", "b" and "c"``."""
    quotes = [quoted(text) for text in texts]
    return quotes[0] if len(quotes) == 1 else f"{', '.join(quotes[:-1])} {word} {quotes[-1]}"


def pose_at(recording: Recording, t: float) -> Pose:
    """Where the robot was at ``t`` seconds: its pose after the last tick until then."""
    ticks = recording.ticks
    done = min(int(t * 30 + 1e-6), len(ticks))
    if done < 1:
        return recording.start
    return Pose(float(ticks.x[done - 1]), float(ticks.y[done - 1]), float(ticks.heading[done - 1]))


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


def fault_words(fault: Fault) -> str:
    """``NameError: name 'x' is not defined (line 3)``."""
    where = f" ({fault.place})" if fault.place else ""
    return f"{fault.message.rstrip('.')}{where}"
