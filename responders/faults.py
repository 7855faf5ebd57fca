"""Faults from the errors of child processes: reported exceptions, ended processes, and errors in our own code.

This module assigns no marks. The modules that serve a child decide when to stop it.
"""

from __future__ import annotations

import errno
import logging
from collections.abc import Mapping
from typing import Any

from responders import wire
from responders.sandbox.meter import ChildStopped
from sim.errors import RobomarkError
from sim.recording import SECOND, Fault, Verdict

_log = logging.getLogger(__name__)
_MAX_HINT_LENGTH = 200
_PYTHON_2 = (
    "Missing parentheses in call to",
    "leading zeros in decimal integer literals",
    "multiple exception types must be parenthesized",
)


class ChildDataError(ChildStopped):
    """Raised when a child's data caused an error in our own code. ``cause`` is for staff."""

    def __init__(self, error: Exception) -> None:
        super().__init__(Verdict.SANDBOX_VIOLATION, "its process sent something that cannot be handled")
        self.cause = f"{type(error).__name__}: {error}"[:300]


def to_child_data_error(error: Exception) -> ChildDataError:
    """Convert an exception that was raised while handling a child's data. Re-raises ``error`` for host faults."""
    if isinstance(error, RobomarkError | OSError | MemoryError):
        raise error
    _log.error("a child has sent what our own code stumbled over", exc_info=error)
    return ChildDataError(error)


def build_stop_fault(stop: ChildStopped, process_name: str, now: int) -> Fault:
    """Return the fault of a child that was stopped or ended at ``now``, in units of simulated time.

    ``process_name`` is the program, the responder, or the name of an agent, as in the functions below.
    """
    verdict = stop.verdict
    if process_name != "program" and verdict is Verdict.PROGRAM_ERROR:
        verdict = Verdict.RESPONDER_ERROR
    cause = stop.cause if isinstance(stop, ChildDataError) else ""
    sentence = f"the {process_name} was stopped: {stop.message}"
    return _build_fault(now, verdict, process_name, sentence, stop.line, staff=cause, file=stop.file or "")


#: Start of the message for a responder that returns something other than a text.
_WRONG_RETURN = "the responder returned "


def describe_wrong_return(description: str) -> str:
    """Return the message for a responder that returned ``description`` instead of a text."""
    return f"{_WRONG_RETURN}{description}"


def is_wrong_return(fault: Fault) -> bool:
    """Return whether the fault is that a responder returned something other than a text.

    Stored recordings contain only the message, and another field would change their format. So the message is parsed
    here, next to the function that creates it, and nowhere else.
    """
    return fault.verdict is Verdict.PROTOCOL_ERROR and fault.message.startswith(_WRONG_RETURN)


def build_error_fault(error: Mapping[str, Any], now: int, process_name: str) -> Fault:
    """Return the fault for an exception that a child reported. Running out of memory counts as a limit."""
    is_out_of_memory = error["type"] == "OSError" and error["text"].startswith(f"[Errno {errno.ENOMEM}]")
    if error["type"] == "MemoryError" or is_out_of_memory:
        sentence = f"the {process_name} asked for more memory than it may have"
        return _build_fault(now, Verdict.MEMORY_LIMIT, process_name, sentence, error["line"], file=error["file"] or "")
    verdict = Verdict.PROGRAM_ERROR if process_name == "program" else Verdict.RESPONDER_ERROR
    text = error["text"]
    sentence = f"{error['type']}: {text}" if text else str(error["type"])
    hint = error.get("hint", "")[:_MAX_HINT_LENGTH]
    if error["type"] == "SyntaxError" and text.startswith(_PYTHON_2):
        hint = 'Programs here are Python 3: print is a function and needs brackets, as in print("hello").'
    return _build_fault(now, verdict, process_name, sentence, error["line"], hint, file=error["file"] or "")


def describe_refusal(process_name: str, frame: wire.Frame) -> str:
    """Return the report's sentence about an operation that the sandbox refused."""
    location = (
        f"line {frame['line']} of {frame['file'] or f'the {process_name}'}"
        if frame["line"] is not None
        else f"the {process_name}"
    )
    return f"{location}: {frame['what'][:200]}"


def _build_fault(
    now: int,
    verdict: Verdict,
    process_name: str,
    sentence: str,
    line: int | None,
    hint: str = "",
    staff: str = "",
    file: str = "",
) -> Fault:
    if process_name == "program":
        return Fault(now / SECOND, verdict, "program", sentence, line, hint, staff=staff, file=file)
    agent = "" if process_name == "responder" else process_name
    return Fault(now / SECOND, verdict, "responder", sentence, line, hint, staff=staff, agent=agent, file=file)
