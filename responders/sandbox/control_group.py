"""Optional control groups (version 2), one for each slot of a worker, where systemd or a container delegates them.

They limit what per-process limits can't, and show the cause when the kernel kills a process for lack of memory.
``zygote.py`` decides which processes join a group.
"""

from __future__ import annotations

import contextlib
import os
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

from sim.errors import HostError

#: Group of the worker itself, because a group with subgroups may not contain processes.
_SERVICE = "robomark-service"
_SLOT = "robomark-slot-"
_REQUIRED_CONTROLLERS = frozenset({"memory", "pids"})
_USED_CONTROLLERS = _REQUIRED_CONTROLLERS | {"io"}
_MEGABYTE = 1 << 20
#: Memory of zygotes, and of children beyond their limits.
_EXTRA_MEMORY = 400 * _MEGABYTE
#: A zygote for each role, some inside bubblewrap, and their children. None of them may start a thread.
_MAX_PROCESSES = 32
#: The default weight is 100.
_DISK_WEIGHT = 10
#: Limit on disk writes, bytes per second. Honest students write a few kilobytes.
_MAX_WRITTEN_BYTES_PER_SECOND = 32 * _MEGABYTE
_MAX_WRITES_PER_SECOND = 500
_END_SECONDS = 2.0
_PROC = Path("/proc")


class _NotDelegated(Exception):
    """Raised when a worker can't have groups here. The message is the end of a sentence."""


def divide_group(proc: Path = _PROC) -> str | None:
    """Create space for slot groups below this process's group, and move the process into a separate one.

    Call it before the process has children. Return the reason if it fails, with nothing changed, otherwise None.
    """
    try:
        group = _locate_delegated_group(proc)
    except _NotDelegated as reason:
        return str(reason)
    service = group / _SERVICE
    try:
        service.mkdir(exist_ok=True)
        (service / "cgroup.procs").write_text("0")
        controllers = _USED_CONTROLLERS & set((group / "cgroup.controllers").read_text().split())
        (group / "cgroup.subtree_control").write_text(" ".join(f"+{name}" for name in sorted(controllers)))
    except OSError as error:
        with contextlib.suppress(OSError):
            (group / "cgroup.procs").write_text("0")
            service.rmdir()
        return f"{group} cannot be divided: {error.strerror}"
    return None


def check_available(proc: Path = _PROC) -> str | None:
    """Return why a worker started from here can't have groups, or None if it can. Changes nothing."""
    try:
        _locate_delegated_group(proc)
    except _NotDelegated as reason:
        return str(reason)
    return None


class ControlGroup:
    """The control group of one slot.

    Zygotes are started through ``command_prefix``; the processes they fork stay in it.
    """

    def __init__(self, folder: Path, memory_mb: int) -> None:
        """Create the group.

        Raises:
            HostError: If it can't be created.
        """
        self._folder = folder
        self._base_memory_bytes = memory_mb * _MEGABYTE
        _remove_stale_groups(folder.parent)
        try:
            folder.mkdir(exist_ok=True)
            self._write_setting("memory.max", self._base_memory_bytes)
            self._write_setting("pids.max", _MAX_PROCESSES)
        except OSError as error:
            raise HostError(f"the control group {folder} cannot be made: {error.strerror}") from None
        disk = _find_disk_number(Path(tempfile.gettempdir()))
        for file, value in (
            ("memory.swap.max", "0"),
            ("io.weight", f"default {_DISK_WEIGHT}"),
            ("io.max", f"{disk} wbps={_MAX_WRITTEN_BYTES_PER_SECOND} wiops={_MAX_WRITES_PER_SECOND}"),
        ):
            # Not supported by all kernels and disks.
            with contextlib.suppress(OSError):
                self._write_setting(file, value)

    @property
    def command_prefix(self) -> list[str]:
        """The command prefix that runs a process in the group."""
        return ["/bin/sh", "-c", 'echo 0 > "$0" && exec "$@"', str(self._folder / "cgroup.procs")]

    def adjust_memory_limit(self, limits_bytes: int) -> None:
        """Set the group's limit so that its processes can have the memory that an assignment allows them together."""
        try:
            self._write_setting("memory.max", max(self._base_memory_bytes, limits_bytes + _EXTRA_MEMORY))
        except OSError as error:
            raise HostError(f"the control group {self._folder} cannot be changed: {error.strerror}") from None

    def watch_memory_kills(self) -> Callable[[], bool]:
        """Return a predicate: whether the kernel has since killed a process for exceeding this group's memory limit.

        The counter ``oom_kill`` is not enough, because it also counts processes killed for a full parent group.
        """
        kill_count, full_count = self._read_events()

        def has_overrun() -> bool:
            new_kill_count, new_full_count = self._read_events()
            return new_kill_count > kill_count and new_full_count > full_count

        return has_overrun

    def close(self) -> None:
        """Kill the remaining processes and remove the group."""
        with contextlib.suppress(OSError):
            self._write_setting("cgroup.kill", 1)
        deadline = time.monotonic() + _END_SECONDS
        while not _try_remove(self._folder) and time.monotonic() < deadline:
            time.sleep(0.01)

    def _read_events(self) -> tuple[int, int]:
        try:
            lines = (self._folder / "memory.events").read_text().splitlines()
        except OSError:
            return 0, 0
        counts = dict(line.split() for line in lines)
        return int(counts.get("oom_kill", 0)), int(counts.get("oom", 0))

    def _write_setting(self, file: str, value: object) -> None:
        (self._folder / file).write_text(str(value))


def create_slot_group(memory_mb: int, proc: Path = _PROC) -> ControlGroup | None:
    """Create the group of this process's slot. Return None unless the worker's own group was divided before.

    Raises:
        HostError: If the group can't be created.
    """
    try:
        own_group = _locate_own_group(proc)
    except _NotDelegated:
        return None
    if own_group.name != _SERVICE:
        return None
    return ControlGroup(own_group.parent / f"{_SLOT}{os.getpid()}", memory_mb)


def _locate_delegated_group(proc: Path) -> Path:
    """Return the group that can be divided or already is.

    Raises:
        _NotDelegated: If there is none.
    """
    own_group = _locate_own_group(proc)
    group = own_group.parent if own_group.name == _SERVICE else own_group
    try:
        missing_controllers = _REQUIRED_CONTROLLERS - set((group / "cgroup.controllers").read_text().split())
        processes = (own_group / "cgroup.procs").read_text().split()
    except OSError as error:
        raise _NotDelegated(f"{own_group} cannot be read: {error.strerror}") from None
    if missing_controllers:
        raise _NotDelegated(f"{group} does not have the controllers {' and '.join(sorted(missing_controllers))}")
    for path in (group, group / "cgroup.procs", group / "cgroup.subtree_control"):
        if not os.access(path, os.W_OK):
            raise _NotDelegated(f"{path} cannot be written")
    if own_group == group and processes != [str(os.getpid())]:
        raise _NotDelegated(f"other processes are in {group}, too")
    return group


def _locate_own_group(proc: Path) -> Path:
    """Return the folder of this process's group.

    Raises:
        _NotDelegated: If there is none.
    """
    try:
        groups = (proc / "self" / "cgroup").read_text().splitlines()
        mounts = (proc / "self" / "mountinfo").read_text().splitlines()
    except OSError as error:
        raise _NotDelegated(f"{error.filename} cannot be read") from None
    group_path = next((line.removeprefix("0::") for line in groups if line.startswith("0::")), None)
    if group_path is None:
        raise _NotDelegated("the kernel has no control groups of version 2")
    for line in mounts:
        mount_fields, _, kind = line.partition(" - ")
        root, mount_point = mount_fields.split()[3:5]
        if kind.startswith("cgroup2 ") and Path(group_path).is_relative_to(root):
            return Path(mount_point) / Path(group_path).relative_to(root)
    raise _NotDelegated("control groups of version 2 are not mounted")


def _remove_stale_groups(group: Path) -> None:
    """Remove the groups of slots whose process was killed before it could remove them."""
    for folder in group.glob(f"{_SLOT}*"):
        if not Path(f"/proc/{folder.name.removeprefix(_SLOT)}").exists():
            _try_remove(folder)


def _try_remove(folder: Path) -> bool:
    try:
        folder.rmdir()
    except FileNotFoundError:
        return True
    except OSError:
        return False
    return True


def _find_disk_number(folder: Path) -> str:
    """Return the device number of the whole disk with this folder, or the folder's own if it is on no disk."""
    number = folder.stat().st_dev
    name = f"{os.major(number)}:{os.minor(number)}"
    with contextlib.suppress(OSError):
        return (Path("/sys/dev/block") / name / ".." / "dev").read_text().strip()
    return name
