"""What the end of a child comes to: a verdict and a sentence, from its wait status and from its last word.

Watching a child and ending it is ``running_child.py``'s.
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

NOWHERE: wire.Frame = {"line": None, "file": None}
_CLOSED = "its process ended without finishing the program"


class KilledFromOutside(HostError):
    """Something that is neither the worker nor the child has ended it: most likely this machine is out of memory."""


def too_busy(cpu_seconds: float, place: wire.Frame) -> ChildStopped:
    """It computed for longer than it may, and was at ``place`` then."""
    sentence = f"it computed for more than {cpu_seconds:g} seconds of CPU time"
    return ChildStopped(Verdict.CPU_LIMIT, sentence, place["line"], place["file"])


def by_itself(status: int, used: float, cpu_seconds: float) -> ChildStopped | None:
    """What the wait status says of a child that ``used`` so many of its CPU seconds; None if it was killed."""
    if not os.WIFSIGNALED(status):
        return ChildStopped(Verdict.PROGRAM_ERROR, _CLOSED)
    number = os.WTERMSIG(status)
    # The kernel's own limit on processor time, a second or two behind ours, ends with SIGKILL too.
    if number == signal.SIGXCPU or (number == signal.SIGKILL and used > cpu_seconds):
        return too_busy(cpu_seconds, NOWHERE)
    if number == signal.SIGSYS:
        return ChildStopped(Verdict.SANDBOX_VIOLATION, "it used a system call that is not allowed")
    if number != signal.SIGKILL:
        return ChildStopped(Verdict.PROGRAM_ERROR, f"its process crashed ({process_state.signal_name(number)})")
    return None


def killed(had_ended: bool, overran: bool, blamed: bool) -> ChildStopped:
    """A child was killed: by us, unless it ``had_ended`` before. Raises KilledFromOutside if that is not its fault.

    ``overran``: with the other processes of its submission it has taken more than they may have. ``blamed``: it ran
    alone on this machine and was killed before.
    """
    if not had_ended:
        # It was alive until we ended it ourselves just now: it had only closed the wire.
        return ChildStopped(Verdict.PROGRAM_ERROR, _CLOSED)
    if overran:
        sentence = "the submission's processes took more memory together than they may have"
        return ChildStopped(Verdict.MEMORY_LIMIT, sentence)
    if blamed:
        sentence = "its process was killed, again and with nothing else running: it takes more memory than there is"
        return ChildStopped(Verdict.MEMORY_LIMIT, sentence)
    raise KilledFromOutside("something on this machine killed a student's process: is there enough memory?")


def place_of(unread: bytes) -> wire.Frame:
    """Where a child that was asked says that it is, among what it had written before."""
    for line in reversed(unread.split(b"\n")):
        # Packed acts may stand before it.
        start = max(line.rfind(wire.BEGINNING), 0)
        with contextlib.suppress(wire.WireError):
            return wire.parse(wire.unnumbered(line[start:])[1], {"busy": wire.ROBOT["busy"]})
    return NOWHERE
