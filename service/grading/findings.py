"""What a criterion observed instead of what it expected, as values, for the hints.

People read the same in the message of the result. Findings exist while a submission is graded and are not stored.
"""

from __future__ import annotations

from dataclasses import dataclass

from sim.recording import Fault


@dataclass(frozen=True, slots=True)
class Finding:
    """What a judge observed in a trial, or in the code, that costs marks."""


@dataclass(frozen=True, slots=True)
class ReportedFault(Finding):
    """The fault that ended the program."""

    fault: Fault


@dataclass(frozen=True, slots=True)
class StrayItems(Finding):
    """Output that was not required. ``is_only_problem`` if all that was required is there."""

    count: int
    is_only_problem: bool


@dataclass(frozen=True, slots=True)
class MissingEntry(Finding):
    """A number or word that a report lacks after the ``previous`` one (empty at its start), and the report's texts."""

    entry: str
    previous: str
    texts: tuple[str, ...]


@dataclass(frozen=True, slots=True)
class ExtraText(Finding):
    """A text that should not have come."""

    text: str


@dataclass(frozen=True, slots=True)
class OtherWord(Finding):
    """A word of a sequence that is not the ``expected`` one (any of several); ``actual`` is empty if none came."""

    previous: tuple[str, ...]
    actual: str
    expected: tuple[str, ...]


@dataclass(frozen=True, slots=True)
class HurriedSpeech(Finding):
    """The robot spoke while it was still speaking."""


@dataclass(frozen=True, slots=True)
class OtherAnswer(Finding):
    """The responder's answer, or its value at the criterion's path."""

    text: str


@dataclass(frozen=True, slots=True)
class UnnamedLabel(Finding):
    """An answer that contains none of the labels."""

    answer: str


@dataclass(frozen=True, slots=True)
class LateResend(Finding):
    """The robot sent a message again after its answer had come."""


@dataclass(frozen=True, slots=True)
class MissingAnswer(Finding):
    """The robot stopped sending a message before an answer had come."""


@dataclass(frozen=True, slots=True)
class FailedCall(Finding):
    """A visible call of a function that returned no value to compare; ``fault`` is None if it has another form.

    ``returned`` is its value then.
    """

    function: str
    fault: Fault | None
    returned: object = None


@dataclass(frozen=True, slots=True)
class WrongReturn(Finding):
    """The value of a function's visible call. ``expected`` is None if several values are allowed."""

    function: str
    expected: object
    returned: object


@dataclass(frozen=True, slots=True)
class WrongHiddenCalls(Finding):
    """Only hidden calls of functions went wrong. Their values are not for students."""


@dataclass(frozen=True, slots=True)
class UnloadedResponder(Finding):
    """The fault that ended the responder while it was loaded, or the first of its functions if all are missing."""

    fault: Fault


@dataclass(frozen=True, slots=True)
class MissingSwitches(Finding):
    """The letters that the magic line lacks."""

    letters: tuple[str, ...]


@dataclass(frozen=True, slots=True)
class OtherReading(Finding):
    """The light reading where the robot stopped, in percent."""

    reading: float


@dataclass(frozen=True, slots=True)
class StillRunning(Finding):
    """The program ran until a limit ended it."""


@dataclass(frozen=True, slots=True)
class OtherMove(Finding):
    """The move that the robot made instead, or in addition, in seconds."""

    seconds: float


@dataclass(frozen=True, slots=True)
class OtherSide(Finding):
    """The robot went or turned to the left instead of to the right, or the reverse."""


@dataclass(frozen=True, slots=True)
class OtherTurn(Finding):
    """The angle by which the robot turned instead, in degrees."""

    degrees: float
