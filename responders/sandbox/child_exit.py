"""The verdict and message for a child that has ended, from its wait status and its last frame.

``running_child.py`` watches children and ends them.
"""

from __future__ import annotations

import contextlib
import os
import signal

from responders import wire
from responders.sandbox import process_state
from responders.sandbox.meter import ChildStopped
from sim.errors import HostError
from sim.recording import Verdict

UNKNOWN_LOCATION: wire.Frame = {"line": None, "file": None}
_CLOSED_MESSAGE = "its process ended without finishing the program"


class KilledFromOutside(HostError):
    """Raised when neither the worker nor the child ended it: most likely the machine is out of memory."""


def build_cpu_stop(cpu_seconds: float, location: wire.Frame) -> ChildStopped:
    """Return the fault of a child that exceeded its CPU limit at ``location``."""
    sentence = f"it computed for more than {cpu_seconds:g} seconds of CPU time"
    return ChildStopped(Verdict.CPU_LIMIT, sentence, location["line"], location["file"])


def explain_exit_status(status: int, used_seconds: float, cpu_seconds: float) -> ChildStopped | None:
    """Return the fault for the wait status of a child that ``used_seconds`` this CPU time, or None if it was killed."""
    if not os.WIFSIGNALED(status):
        return ChildStopped(Verdict.PROGRAM_ERROR, _CLOSED_MESSAGE)
    number = os.WTERMSIG(status)
    # The kernel's limit on processor time, a second or two above ours, also ends with SIGKILL.
    if number == signal.SIGXCPU or (number == signal.SIGKILL and used_seconds > cpu_seconds):
        return build_cpu_stop(cpu_seconds, UNKNOWN_LOCATION)
    if number == signal.SIGSYS:
        return ChildStopped(Verdict.SANDBOX_VIOLATION, "it used a system call that is not allowed")
    if number != signal.SIGKILL:
        return ChildStopped(Verdict.PROGRAM_ERROR, f"its process crashed ({process_state.find_signal_name(number)})")
    return None


def explain_kill(has_ended: bool, has_overrun: bool, is_blamed: bool) -> ChildStopped:
    """Return the fault of a child that was killed: by the worker, unless it ``has_ended`` before.

    Args:
        has_ended: The child had ended before the worker killed it.
        has_overrun: The processes of the submission together exceeded their memory limit.
        is_blamed: The child ran alone on this machine and had been killed before.

    Raises:
        KilledFromOutside: If the child did not cause it.
    """
    if not has_ended:
        # The child was running until the worker killed it: it had only closed the wire.
        return ChildStopped(Verdict.PROGRAM_ERROR, _CLOSED_MESSAGE)
    if has_overrun:
        sentence = "the submission's processes took more memory together than they may have"
        return ChildStopped(Verdict.MEMORY_LIMIT, sentence)
    if is_blamed:
        sentence = "its process was killed, again and with nothing else running: it takes more memory than there is"
        return ChildStopped(Verdict.MEMORY_LIMIT, sentence)
    raise KilledFromOutside("something on this machine killed a student's process: is there enough memory?")


def parse_location(unread_output: bytes) -> wire.Frame:
    """Parse the location that a child reports on request, from its unread output."""
    for line in reversed(unread_output.split(b"\n")):
        # Packets may precede the frame.
        start = max(line.rfind(wire.LINE_START), 0)
        with contextlib.suppress(wire.WireError):
            return wire.parse_frame(wire.split_number(line[start:])[1], {"busy": wire.ROBOT["busy"]})
    return UNKNOWN_LOCATION
