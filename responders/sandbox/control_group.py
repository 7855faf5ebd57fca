"""A control group (version 2) for each slot of a worker, where systemd or a container lets the worker have some.

An extra: it holds what no limit on a single process holds, and says whose fault it is when the kernel kills for want
of memory. Which processes belong into one is ``zygote.py``'s.
"""

from __future__ import annotations

import contextlib
import os
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

from sim.errors import HostError

#: Where the worker itself goes: a group that is divided may have no processes of its own.
_SERVICE = "robomark-service"
_SLOT = "robomark-slot-"
_NEEDED = frozenset({"memory", "pids"})
_WANTED = _NEEDED | {"io"}
_MEGABYTE = 1 << 20
#: What zygotes take, and their children beyond their limits.
_BESIDE_LIMITS = 400 * _MEGABYTE
#: A zygote for each role, some inside bubblewrap, and their children; none of them may have a thread more.
_MOST_PROCESSES = 32
#: Of a hundred, which is what others have.
_DISK_WEIGHT = 10
#: To the disk, and only there: honest students write a few kilobytes.
_WRITTEN_A_SECOND = 32 * _MEGABYTE
_WRITES_A_SECOND = 500
_END_SECONDS = 2.0
_PROC = Path("/proc")


class _NotDelegated(Exception):
    """Why a worker can have no groups here: the end of a sentence."""


def divide(proc: Path = _PROC) -> str | None:
    """Make room for the groups of slots below that of this process, which goes into one of its own.

    To be called before it has children. What keeps it from doing so, in which case nothing has changed; else None.
    """
    try:
        group = _delegated(proc)
    except _NotDelegated as reason:
        return str(reason)
    service = group / _SERVICE
    try:
        service.mkdir(exist_ok=True)
        (service / "cgroup.procs").write_text("0")
        wanted = _WANTED & set((group / "cgroup.controllers").read_text().split())
        (group / "cgroup.subtree_control").write_text(" ".join(f"+{name}" for name in sorted(wanted)))
    except OSError as error:
        with contextlib.suppress(OSError):
            (group / "cgroup.procs").write_text("0")
            service.rmdir()
        return f"{group} cannot be divided: {error.strerror}"
    return None


def why_not(proc: Path = _PROC) -> str | None:
    """What keeps a worker that is started from here from having them; None if nothing does. Changes nothing."""
    try:
        _delegated(proc)
    except _NotDelegated as reason:
        return str(reason)
    return None


class ControlGroup:
    """That of one slot: its zygotes are started through ``joining``, and what they fork stays in."""

    def __init__(self, folder: Path, memory_mb: int) -> None:
        """Raises HostError when it cannot be had."""
        self._folder = folder
        self._least = memory_mb * _MEGABYTE
        _remove_left_overs(folder.parent)
        try:
            folder.mkdir(exist_ok=True)
            self._write("memory.max", self._least)
            self._write("pids.max", _MOST_PROCESSES)
        except OSError as error:
            raise HostError(f"the control group {folder} cannot be made: {error.strerror}") from None
        disk = _disk(Path(tempfile.gettempdir()))
        for file, value in (
            ("memory.swap.max", "0"),
            ("io.weight", f"default {_DISK_WEIGHT}"),
            ("io.max", f"{disk} wbps={_WRITTEN_A_SECOND} wiops={_WRITES_A_SECOND}"),
        ):
            # Not every kernel has them, nor every disk.
            with contextlib.suppress(OSError):
                self._write(file, value)

    @property
    def joining(self) -> list[str]:
        """The beginning of a command that runs in the group."""
        return ["/bin/sh", "-c", 'echo 0 > "$0" && exec "$@"', str(self._folder / "cgroup.procs")]

    def make_room(self, limits_bytes: int) -> None:
        """What an assignment allows its processes together, they can have: who takes more is at fault."""
        try:
            self._write("memory.max", max(self._least, limits_bytes + _BESIDE_LIMITS))
        except OSError as error:
            raise HostError(f"the control group {self._folder} cannot be changed: {error.strerror}") from None

    def watch(self) -> Callable[[], bool]:
        """Whether the kernel has killed in it since, because this group, and not the machine, was out of memory.

        ``oom_kill`` alone does not say so: it also counts who was killed because a group above was full.
        """
        killed, full = self._events()

        def overran() -> bool:
            killed_now, full_now = self._events()
            return killed_now > killed and full_now > full

        return overran

    def close(self) -> None:
        """End what is still in it, and remove it."""
        with contextlib.suppress(OSError):
            self._write("cgroup.kill", 1)
        until = time.monotonic() + _END_SECONDS
        while not _removed(self._folder) and time.monotonic() < until:
            time.sleep(0.01)

    def _events(self) -> tuple[int, int]:
        try:
            lines = (self._folder / "memory.events").read_text().splitlines()
        except OSError:
            return 0, 0
        counts = dict(line.split() for line in lines)
        return int(counts.get("oom_kill", 0)), int(counts.get("oom", 0))

    def _write(self, file: str, value: object) -> None:
        (self._folder / file).write_text(str(value))


def for_this_process(memory_mb: int, proc: Path = _PROC) -> ControlGroup | None:
    """That of this process's slot, in a worker that could ``divide`` its own; else None. Raises HostError."""
    try:
        own = _own(proc)
    except _NotDelegated:
        return None
    if own.name != _SERVICE:
        return None
    return ControlGroup(own.parent / f"{_SLOT}{os.getpid()}", memory_mb)


def _delegated(proc: Path) -> Path:
    """The group that may be divided, or is. Raises _NotDelegated."""
    own = _own(proc)
    group = own.parent if own.name == _SERVICE else own
    try:
        missing = _NEEDED - set((group / "cgroup.controllers").read_text().split())
        processes = (own / "cgroup.procs").read_text().split()
    except OSError as error:
        raise _NotDelegated(f"{own} cannot be read: {error.strerror}") from None
    if missing:
        raise _NotDelegated(f"{group} does not have the controllers {' and '.join(sorted(missing))}")
    for each in (group, group / "cgroup.procs", group / "cgroup.subtree_control"):
        if not os.access(each, os.W_OK):
            raise _NotDelegated(f"{each} cannot be written")
    if own == group and processes != [str(os.getpid())]:
        raise _NotDelegated(f"other processes are in {group}, too")
    return group


def _own(proc: Path) -> Path:
    """The folder of this process's group. Raises _NotDelegated."""
    try:
        groups = (proc / "self" / "cgroup").read_text().splitlines()
        mounts = (proc / "self" / "mountinfo").read_text().splitlines()
    except OSError as error:
        raise _NotDelegated(f"{error.filename} cannot be read") from None
    own = next((line.removeprefix("0::") for line in groups if line.startswith("0::")), None)
    if own is None:
        raise _NotDelegated("the kernel has no control groups of version 2")
    for line in mounts:
        place, _, kind = line.partition(" - ")
        root, mounted = place.split()[3:5]
        if kind.startswith("cgroup2 ") and Path(own).is_relative_to(root):
            return Path(mounted) / Path(own).relative_to(root)
    raise _NotDelegated("control groups of version 2 are not mounted")


def _remove_left_overs(group: Path) -> None:
    """Remove the groups of slots whose process was killed before it could do so itself."""
    for folder in group.glob(f"{_SLOT}*"):
        if not Path(f"/proc/{folder.name.removeprefix(_SLOT)}").exists():
            _removed(folder)


def _removed(folder: Path) -> bool:
    try:
        folder.rmdir()
    except FileNotFoundError:
        return True
    except OSError:
        return False
    return True


def _disk(folder: Path) -> str:
    """The number of the whole disk on which a folder lies; of what is no disk, its own."""
    number = folder.stat().st_dev
    name = f"{os.major(number)}:{os.minor(number)}"
    with contextlib.suppress(OSError):
        return (Path("/sys/dev/block") / name / ".." / "dev").read_text().strip()
    return name
