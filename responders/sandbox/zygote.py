"""A process with imports loaded, from which the children of one role are forked, and the sandbox round them.

Nothing of the worker's reaches it: it is a fresh process with a clean environment. Which zygotes a worker has is
``manager.py``'s; listening to a child and stopping it is ``running_child.py``'s.
"""

from __future__ import annotations

import array
import contextlib
import functools
import importlib.machinery
import importlib.util
import json
import os
import select
import signal
import socket
import struct
import subprocess
import sys
from collections.abc import Mapping, Set
from dataclasses import dataclass
from pathlib import Path
from types import MappingProxyType
from typing import Any, Literal

from responders import wire
from responders.sandbox import bubblewrap, zygote_command
from responders.sandbox.child_ends import KilledFromOutside
from responders.sandbox.control_group import ControlGroup
from responders.sandbox.meter import ChildStopped, JobMeter
from responders.sandbox.private_folders import PrivateFolders
from responders.sandbox.running_child import Child, ChildLimits
from sim.errors import HostError

Role = Literal["robot", "robot with libraries", "responder", "responder with libraries"]
Work = Literal["role", "battery"]

_HERE = Path(__file__).resolve().parent
_START_SECONDS = 60.0
_END_SECONDS = 0.5
_FILE_BYTES = 4 << 20
_RECYCLE_AFTER = 1000
_MOST_PROCESSORS = 1024
#: How a zygote tells that a child has ended: the wait status, seconds and microseconds of the user's and the system's.
_ENDED = struct.Struct("=i4x4q")
_BATTERY_LIMITS = ChildLimits(2.0, 64 << 20)
_FOLDERS: dict[Role, tuple[str, str]] = {
    "robot": ("sim", "brick"),
    "robot with libraries": ("sim", "brick"),
    "responder": ("responders", "kit"),
    "responder with libraries": ("responders", "kit"),
}
ROLES: tuple[Role, ...] = tuple(_FOLDERS)
#: Of each role, the one that has the libraries loaded too.
WITH_LIBRARIES: Mapping[Role, Role] = MappingProxyType(
    {
        "robot": "robot with libraries",
        "robot with libraries": "robot with libraries",
        "responder": "responder with libraries",
        "responder with libraries": "responder with libraries",
    }
)


class SandboxMissing(HostError):
    """This machine cannot put up the sandbox that student code needs."""


class _ZygoteEnded(KilledFromOutside):
    """A zygote is gone, and with it every child of its."""


@dataclass(frozen=True, slots=True)
class Isolation:
    """Which layers are asked for: Landlock up to a version of its interface (0: none), and the system call filter.

    The doorkeeper and bubblewrap are added where they work, and done without where they do not.
    """

    landlock: int = 99
    seccomp: bool = True
    doorkeeper: bool = True
    bubblewrap: bool = True


#: What every grading needs.
FULL = Isolation()
#: Limits on the process and nothing else: for development only.
NONE = Isolation(landlock=0, seccomp=False, doorkeeper=False, bubblewrap=False)


def stamp(standing: wire.Frame, bubblewrap: bool, control_group: bool) -> str:
    """What grades and reports say of the layers that stood."""
    layers = [f"Landlock {standing['landlock']}"] * bool(standing["landlock"]) + ["seccomp"] * standing["seccomp"]
    layers += ["doorkeeper"] * (standing["without_doorkeeper"] is None) + ["own user"] * standing["own_user"]
    layers += ["bubblewrap"] * bubblewrap + ["control group"] * control_group
    layers += ["fixed addresses"] * (bool(layers) and standing["fixed_addresses"])
    policy = standing["policy"]
    return ", ".join([*layers, "process limits", f"policy {policy}"]) if layers else "process limits only"


class Zygote:
    """A process with the imports of one role loaded, but those that it is ``without``; children are forked from it."""

    def __init__(
        self,
        role: Role,
        sandbox: Isolation,
        folders: PrivateFolders,
        group: ControlGroup | None = None,
        without: tuple[str, ...] = (),
    ) -> None:
        self._role = role
        self._group = group
        self._without = without
        self._sandbox = sandbox
        self._folders = folders
        self._folders_inside = -1  # a descriptor of the folder of folders, as the zygote sees it
        self._forks = self._living = 0  # children that were forked, and of them those that are not gone
        #: Why bubblewrap does not stand round it; None when it does.
        self.without_bubblewrap: str | None = "not asked for"
        #: Why its children can name any path; None when a doorkeeper decides about those.
        self.without_doorkeeper: str | None = "no child has been forked"
        self.children_cpu_seconds = 0.0  # of all children that are gone
        self._sockets: tuple[socket.socket, ...] = ()  # to the zygote, for orders, and to children, for their specs
        self._process: subprocess.Popen[bytes] | None = None

    def spawn(
        self,
        limits: ChildLimits,
        folder: Path | None = None,
        meter: JobMeter | None = None,
        work: Work = "role",
        blamed: bool = False,
    ) -> Child:
        """A fresh child in ``folder``, a private one, or with none. Raises HostError if the machine cannot give one."""
        if folder is not None and folder.parent != self._folders.path:
            raise ValueError(f"{folder} is not a private folder")
        if self._forks >= _RECYCLE_AFTER and not self._living:
            self.close()
        self._forks += 1
        for attempt in (1, 2):
            try:
                return self._spawn(limits, folder, meter or JobMeter(), work, blamed)
            except (OSError, EOFError, _ZygoteEnded) as error:
                self.close()
                if attempt == 2:
                    raise HostError(f"the {self._role} zygote does not answer ({error})") from error
        raise AssertionError

    def try_isolation(self) -> str:
        """Let a child try the short battery of escapes; which layers held. Raises SandboxMissing if one did not."""
        if not self._sandbox.landlock and not self._sandbox.seccomp:
            child = self.spawn(_BATTERY_LIMITS)
            child.close()
            return child.sandbox
        child = self.spawn(_BATTERY_LIMITS, work="battery")
        try:
            told = child.receive(wire.BATTERY)
        except ChildStopped as stop:
            raise _sandbox_missing(f"the battery of escapes did not come to its end ({stop.message})") from None
        finally:
            child.close()
        if told["through"] and self._sandbox.landlock and self._sandbox.seccomp:
            raise _sandbox_missing(f"they let through: {', '.join(str(name)[:60] for name in told['through'])}")
        refused = told["tried"] - len(told["through"])
        return f"{child.sandbox} (battery {told['version']}: {refused} of {told['tried']} refused)"

    def reap(self, pid: int) -> int:
        """The wait status of a child that has been killed or has ended. Raises HostError when the zygote is gone."""
        try:
            ended, _ = self._order(pid)
            self._living -= 1
            status, *used = _ENDED.unpack_from(ended)
            self.children_cpu_seconds += sum(used[0::2]) + sum(used[1::2]) / 1e6
            return int(status)
        except (OSError, EOFError, struct.error) as error:
            # Its children died with it, and that is no fault of a student's.
            self.close()
            raise _ZygoteEnded(f"the {self._role} zygote ended while a program ran") from error

    def close(self) -> None:
        """End the zygote, by force if it does not end by itself, and close what leads to it."""
        for opened in self._sockets:
            opened.close()
        self._sockets = ()
        if self._process is not None:
            # It ends by itself then, and its doorkeeper after it, unless it is stuck.
            with contextlib.suppress(subprocess.TimeoutExpired):
                self._process.wait(_END_SECONDS)
            self._process.kill()
            self._process.wait()
            self._process = None
        if self._folders_inside >= 0:
            os.close(self._folders_inside)
            self._folders_inside = -1
        self._forks = self._living = 0

    def _spawn(self, limits: ChildLimits, folder: Path | None, meter: JobMeter, work: Work, blamed: bool) -> Child:
        self._start()
        folders = []
        if folder is not None:
            # Opened as the zygote sees it: with name spaces of its own, our path to it leads nowhere there.
            folders = [os.open(folder.name, os.O_RDONLY | os.O_DIRECTORY, dir_fd=self._folders_inside)]
        reading, their_writing = os.pipe()
        their_reading, writing = os.pipe()
        try:
            data, received = self._fork(
                {
                    "work": work,
                    "processors": _mask(os.sched_getaffinity(0)),
                    "cpu": limits.cpu_seconds,
                    "memory": limits.memory_bytes,
                    "without": limits.without,
                    "file_size": _FILE_BYTES,
                    "folder": folder is not None,
                    "landlock": self._sandbox.landlock,
                    "seccomp": self._sandbox.seccomp,
                    "doorkeeper": self._sandbox.doorkeeper,
                },
                [their_writing, their_reading, *folders],
            )
        except BaseException:
            _close(reading, writing)
            raise
        finally:
            _close(their_writing, their_reading, *folders)
        answer = json.loads(data)
        if "missing" in answer:
            _close(reading, writing)
            raise _sandbox_missing(answer["missing"])
        self._living += 1
        inside = answer["pid"]  # what the zygote calls it
        reap = functools.partial(self.reap, inside)
        child = Child(reap, _pid(received[0]), received[0], (reading, writing), limits, folder)
        try:
            _try_to_signal(received[0])
            self._check_isolation(child)
        except BaseException:
            child.close()
            raise
        watch = self._group.watch() if self._group is not None else None
        child.begin(meter, blamed, self._role in WITH_LIBRARIES.values(), watch)
        return child

    def _check_isolation(self, child: Child) -> None:
        """The child's first words, before any student code: every layer asked for must stand."""
        try:
            standing = child.receive(wire.SANDBOX)
        except ChildStopped as stop:
            raise EOFError(stop.message) from None
        if standing["missing"] is not None:
            raise _sandbox_missing(standing["missing"])
        if bool(standing["landlock"]) != bool(self._sandbox.landlock) or standing["seccomp"] != self._sandbox.seccomp:
            raise _sandbox_missing("a layer that was asked for does not stand")
        self.without_doorkeeper = standing["without_doorkeeper"]
        child.sandbox = stamp(standing, self.without_bubblewrap is None, self._group is not None)

    def _start(self) -> None:
        """Begin, if need be, and wait until it has imported."""
        self.begin()
        if self._folders_inside >= 0 or self._comes_up():
            return
        if self.without_bubblewrap is None:
            self.without_bubblewrap = "what Python needs cannot be seen in it"
            self._exec([])
            if self._comes_up():
                return
        raise HostError(f"the {self._role} zygote did not start")

    def begin(self) -> None:
        """Let it import meanwhile: the first child will wait for it. Raises OSError if it cannot be started at all."""
        if self._process is not None and self._process.poll() is None:
            return
        keep_bytecode(_HERE / "inside")
        keep_bytecode(Path(own_modules(self._role)))
        wrapping: list[str] = []
        if self._sandbox.bubblewrap:
            wrapping = bubblewrap.wrapping([str(_HERE), own_modules(self._role)], self._folders.path)
            self.without_bubblewrap = bubblewrap.why_not(wrapping)
        self._exec(wrapping if self.without_bubblewrap is None else [])

    def _comes_up(self) -> bool:
        try:
            _, received = self._answer()
        except (OSError, EOFError):
            self.close()
            return False
        self._folders_inside = received[0]
        return True

    def _exec(self, wrapping: list[str]) -> None:
        """Exec a clean process, with nothing of ours in its environment."""
        self.close()
        pairs = [socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET) for _ in range(2)]
        ours, theirs = zip(*pairs, strict=True)
        numbers = [each.fileno() for each in theirs]
        joining = self._group.joining if self._group is not None else []
        arguments = [str(_HERE), self._role, str(self._folders.path), " ".join(self._without), own_modules(self._role)]
        try:
            self._process = subprocess.Popen(
                [*joining, *wrapping, *zygote_command.command(numbers, arguments)],
                pass_fds=numbers,
                stdin=subprocess.DEVNULL,
                stdout=subprocess.DEVNULL,
                cwd="/",
                env=zygote_command.environment(),
            )
        finally:
            for each in theirs:
                each.close()
        self._sockets = ours

    def _fork(self, spec: dict[str, Any], descriptors: list[int]) -> tuple[bytes, list[int]]:
        """Have a child forked, which reads its spec; its answer."""
        _, specs = self._running()
        payload = array.array("i", descriptors)
        specs.sendmsg([json.dumps(spec).encode()], [(socket.SOL_SOCKET, socket.SCM_RIGHTS, payload)])
        return self._order(0, answers=1)

    def _order(self, number: int, answers: int = 0) -> tuple[bytes, list[int]]:
        """Send an order to the zygote: zero, or the child that is to be reaped. The answer, from one of the sockets."""
        self._running()[0].send(number.to_bytes(4, "little"))
        return self._answer(answers)

    def _answer(self, which: int = 0) -> tuple[bytes, list[int]]:
        sockets = self._running()
        answered, control = sockets[which], sockets[0]
        ready = select.select({answered, control}, [], [], _START_SECONDS)[0]
        if not ready:
            raise EOFError("no answer")
        data, received, _, _ = (answered if answered in ready else control).recvmsg(65536, socket.CMSG_SPACE(8 * 4))
        if not data:
            raise EOFError("it ended")
        found = array.array("i")
        for _, _, part in received:
            found.frombytes(part[: len(part) - len(part) % 4])
        return data, list(found)

    def _running(self) -> tuple[socket.socket, ...]:
        if not self._sockets:
            raise EOFError("it is not running")
        return self._sockets


def _mask(processors: Set[int]) -> str:
    """A bit each, as many digits whichever they are: how long a spec is shows in a child's addresses."""
    return sum(1 << number for number in processors).to_bytes(_MOST_PROCESSORS // 8, "little").hex()


def _close(*descriptors: int) -> None:
    for fd in descriptors:
        os.close(fd)


def _pid(pidfd: int) -> int:
    """What we call the process; in name spaces of its own it has another number."""
    lines = Path(f"/proc/self/fdinfo/{pidfd}").read_text().splitlines()
    return next(int(line.split()[1]) for line in lines if line.startswith("Pid:"))


def _try_to_signal(pidfd: int) -> None:
    try:
        signal.pidfd_send_signal(pidfd, 0)
    except OSError as error:
        raise _sandbox_missing(f"pidfd_send_signal: {error.strerror}") from None


def _sandbox_missing(what: str) -> SandboxMissing:
    return SandboxMissing(
        f"this machine cannot enclose student code: {what}; "
        "Robomark needs Linux 5.13 or later with Landlock and seccomp (in a container: Docker 23 or later)"
    )


def own_modules(role: Role) -> str:
    """The folder with what a role's children import of ours."""
    package, folder = _FOLDERS[role]
    return str(_package_folder(package) / folder)


@functools.cache
def keep_bytecode(folder: Path) -> None:
    """Have Python keep what it compiles of these modules, as of any: zygotes keep nothing, each would do it anew."""
    if sys.dont_write_bytecode:
        return
    for file in folder.rglob("*.py"):
        kept = Path(importlib.util.cache_from_source(file))
        if os.access(file.parent, os.W_OK) and not (kept.exists() and kept.stat().st_mtime >= file.stat().st_mtime):
            found = importlib.machinery.PathFinder.find_spec(file.stem, [str(file.parent)])
            assert found is not None
            assert isinstance(found.loader, importlib.machinery.SourceFileLoader)
            found.loader.get_code(file.stem)


def _package_folder(name: str) -> Path:
    specification = importlib.util.find_spec(name)
    assert specification is not None
    assert specification.submodule_search_locations
    return Path(specification.submodule_search_locations[0]).resolve()
