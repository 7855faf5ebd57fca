"""A zygote: a process with loaded imports that forks the children of one role, and the sandbox around them.

It is a fresh process with a clean environment, without data of the worker. ``manager.py`` keeps a worker's zygotes.
``running_child.py`` communicates with a child.
"""

from __future__ import annotations

import array
import contextlib
import functools
import json
import os
import select
import signal
import socket
import struct
import subprocess
import sys
from collections.abc import Sequence, Set
from pathlib import Path
from typing import Any, Literal

from responders import wire
from responders.sandbox import bubblewrap
from responders.sandbox.child_exit import KilledFromOutside
from responders.sandbox.control_group import ControlGroup
from responders.sandbox.isolation import Isolation, build_missing_error, describe_layers
from responders.sandbox.meter import ChildStopped, JobMeter
from responders.sandbox.private_folders import PrivateFolders
from responders.sandbox.processor import ALLOWED
from responders.sandbox.roles import WITH_LIBRARIES, ChildRole, compile_bytecode, find_module_folder
from responders.sandbox.running_child import Child, ChildLimits
from sim.errors import HostError
from sim.processes import build_arithmetic_environment, build_python_command

ChildWork = Literal["role", "battery"]

_SANDBOX_FOLDER = Path(__file__).resolve().parent
_START_SECONDS = 60.0
_END_SECONDS = 0.5
_FILE_BYTES = 4 << 20
_RECYCLE_AFTER = 1000
_MAX_PROCESSORS = 1024
#: Report of an ended child: wait status, and user and system time as seconds and microseconds.
_EXIT_REPORT = struct.Struct("=i4x4q")
_BATTERY_LIMITS = ChildLimits(2.0, 64 << 20)
#: Start of a command with fixed memory addresses, because objects are hashed by address. The setting is inherited, so
#: it is made in a separate process, not in the worker. An exec that restores root's capabilities resets it;
#: bubblewrap's root process keeps the right to give them up (SECBIT_NOROOT) only for this.
_FIXED_ADDRESS_COMMAND = (
    sys.executable,
    *("-I", "-S", "-c"),
    "import ctypes, os, sys; libc = ctypes.CDLL(None); PR_SET_SECUREBITS, NOROOT_LOCKED, PR_CAP_AMBIENT, IS_SET, "
    "LOWER, CAP_SETPCAP = 28, 3, 47, 1, 3, 8; in_bubblewrap = libc.prctl(PR_CAP_AMBIENT, IS_SET, CAP_SETPCAP, 0, 0) "
    "== 1; in_bubblewrap and libc.prctl(PR_SET_SECUREBITS, NOROOT_LOCKED, 0, 0, 0); in_bubblewrap and "
    "libc.prctl(PR_CAP_AMBIENT, LOWER, CAP_SETPCAP, 0, 0); libc.personality(0x40000); os.execv(sys.argv[1], "
    "sys.argv[1:])",
)
_START_CODE = (
    f"import os, sys; os.sched_setaffinity(0, {sorted(ALLOWED)}); "
    "high = [os.dup2(int(fd), 100 + place) for place, fd in enumerate(sys.argv[1:3])]; "
    "os.dup2(high[0], 3); os.dup2(high[1], 4); os.closerange(5, 1 << 16); sys.path.insert(0, sys.argv[3]); "
    "from inside.zygote import main; main(sys.argv[4], sys.argv[5], sys.argv[6].split(), sys.argv[7:])"
)


class _ZygoteEnded(KilledFromOutside):
    """Raised when a zygote has ended, and all of its children with it."""


class Zygote:
    """A process with the imports of one role, except the packages in ``without``. Children are forked from it."""

    def __init__(
        self,
        role: ChildRole,
        isolation: Isolation,
        folders: PrivateFolders,
        group: ControlGroup | None = None,
        exclusions: tuple[str, ...] = (),
    ) -> None:
        self._role = role
        self._group = group
        self._exclusions = exclusions
        self._sandbox = isolation
        self._folders = folders
        self._folders_inside = -1  # descriptor of the private folders' parent, opened inside the zygote
        self._forks = self._living = 0  # forked children, and those not yet ended
        #: Reason for running without bubblewrap, or None if it is used.
        self.without_bubblewrap: str | None = "not asked for"
        #: Reason for running without a doorkeeper, so children can name any path, or None if it is used.
        self.without_doorkeeper: str | None = "no child has been forked"
        self.children_cpu_seconds = 0.0  # of all ended children
        self._sockets: tuple[socket.socket, ...] = ()  # to the zygote for orders, and to children for specs
        self._process: subprocess.Popen[bytes] | None = None

    def spawn(
        self,
        limits: ChildLimits,
        folder: Path | None = None,
        meter: JobMeter | None = None,
        work: ChildWork = "role",
        is_blamed: bool = False,
    ) -> Child:
        """Return a fresh child, in a private ``folder`` or with none.

        Raises:
            HostError: If the machine can't provide one.
        """
        if folder is not None and folder.parent != self._folders.path:
            raise ValueError(f"{folder} is not a private folder")
        if self._forks >= _RECYCLE_AFTER and not self._living:
            self.close()
        self._forks += 1
        for attempt in (1, 2):
            try:
                return self._spawn(limits, folder, meter or JobMeter(), work, is_blamed)
            except (OSError, EOFError, _ZygoteEnded) as error:
                self.close()
                if attempt == 2:
                    raise HostError(f"the {self._role} zygote does not answer ({error})") from error
        raise AssertionError

    def check_isolation(self) -> str:
        """Run the short battery of escape attempts in a child. Return the layers that blocked them.

        Raises:
            SandboxMissing: If a layer failed.
        """
        if not self._sandbox.landlock and not self._sandbox.seccomp:
            child = self.spawn(_BATTERY_LIMITS)
            child.close()
            return child.sandbox
        child = self.spawn(_BATTERY_LIMITS, work="battery")
        try:
            report = child.receive(wire.BATTERY)
        except ChildStopped as stop:
            raise build_missing_error(f"the battery of escapes did not come to its end ({stop.message})") from None
        finally:
            child.close()
        if report["through"] and self._sandbox.landlock and self._sandbox.seccomp:
            raise build_missing_error(f"they let through: {', '.join(str(name)[:60] for name in report['through'])}")
        refusals = report["tried"] - len(report["through"])
        return f"{child.sandbox} (battery {report['version']}: {refusals} of {report['tried']} refused)"

    def reap(self, pid: int) -> int:
        """Return the wait status of a child that has ended.

        Raises:
            HostError: If the zygote has ended.
        """
        try:
            exit_report, _ = self._send_order(pid)
            self._living -= 1
            status, *cpu_times = _EXIT_REPORT.unpack_from(exit_report)
            self.children_cpu_seconds += sum(cpu_times[0::2]) + sum(cpu_times[1::2]) / 1e6
            return int(status)
        except (OSError, EOFError, struct.error) as error:
            # The children died with the zygote, which is not the student's fault.
            self.close()
            raise _ZygoteEnded(f"the {self._role} zygote ended while a program ran") from error

    def close(self) -> None:
        """End the zygote, by force if necessary, and close its sockets."""
        for open_socket in self._sockets:
            open_socket.close()
        self._sockets = ()
        if self._process is not None:
            # The zygote ends by itself when its sockets close, and its doorkeeper after it, unless it hangs.
            with contextlib.suppress(subprocess.TimeoutExpired):
                self._process.wait(_END_SECONDS)
            self._process.kill()
            self._process.wait()
            self._process = None
        if self._folders_inside >= 0:
            os.close(self._folders_inside)
            self._folders_inside = -1
        self._forks = self._living = 0

    def _spawn(
        self, limits: ChildLimits, folder: Path | None, meter: JobMeter, work: ChildWork, is_blamed: bool
    ) -> Child:
        self._start()
        folders = []
        if folder is not None:
            # Opened relative to the zygote's view: its namespaces don't contain our path.
            folders = [os.open(folder.name, os.O_RDONLY | os.O_DIRECTORY, dir_fd=self._folders_inside)]
        reading, their_writing = os.pipe()
        their_reading, writing = os.pipe()
        try:
            data, received = self._fork(
                {
                    "work": work,
                    "processors": _encode_processors(os.sched_getaffinity(0)),
                    "cpu": limits.cpu_seconds,
                    "memory": limits.memory_bytes,
                    "without": limits.excluded_modules,
                    "file_size": _FILE_BYTES,
                    "folder": folder is not None,
                    "landlock": self._sandbox.landlock,
                    "seccomp": self._sandbox.seccomp,
                    "doorkeeper": self._sandbox.doorkeeper,
                },
                [their_writing, their_reading, *folders],
            )
        except BaseException:
            _close_descriptors(reading, writing)
            raise
        finally:
            _close_descriptors(their_writing, their_reading, *folders)
        answer = json.loads(data)
        if "missing" in answer:
            _close_descriptors(reading, writing)
            raise build_missing_error(answer["missing"])
        self._living += 1
        inner_pid = answer["pid"]  # the id inside the zygote's namespace
        reap = functools.partial(self.reap, inner_pid)
        child = Child(reap, _read_pid(received[0]), received[0], (reading, writing), limits, folder)
        try:
            _check_signal(received[0])
            self._check_layers(child)
        except BaseException:
            child.close()
            raise
        watch = self._group.watch_memory_kills() if self._group is not None else None
        child.begin(meter, is_blamed, self._role in WITH_LIBRARIES.values(), watch)
        return child

    def _check_layers(self, child: Child) -> None:
        """Check the child's first frame, sent before any student code: every requested layer must be active."""
        try:
            active_layers = child.receive(wire.SANDBOX)
        except ChildStopped as stop:
            raise EOFError(stop.message) from None
        if active_layers["missing"] is not None:
            raise build_missing_error(active_layers["missing"])
        if (
            bool(active_layers["landlock"]) != bool(self._sandbox.landlock)
            or active_layers["seccomp"] != self._sandbox.seccomp
        ):
            raise build_missing_error("a layer that was asked for does not stand")
        self.without_doorkeeper = active_layers["without_doorkeeper"]
        child.sandbox = describe_layers(active_layers, self.without_bubblewrap is None, self._group is not None)

    def _start(self) -> None:
        """Start the zygote if necessary and wait until its imports are loaded."""
        self.begin()
        if self._folders_inside >= 0 or self._wait_until_ready():
            return
        if self.without_bubblewrap is None:
            self.without_bubblewrap = "what Python needs cannot be seen in it"
            self._start_process([])
            if self._wait_until_ready():
                return
        raise HostError(f"the {self._role} zygote did not start")

    def begin(self) -> None:
        """Start the zygote without waiting: the first child waits for its imports.

        Raises:
            OSError: If it can't be started.
        """
        if self._process is not None and self._process.poll() is None:
            return
        compile_bytecode(_SANDBOX_FOLDER / "inside")
        compile_bytecode(Path(find_module_folder(self._role)))
        wrapping: list[str] = []
        if self._sandbox.bubblewrap:
            wrapping = bubblewrap.build_command_prefix(
                [str(_SANDBOX_FOLDER), find_module_folder(self._role)], self._folders.path
            )
            self.without_bubblewrap = bubblewrap.check_available(wrapping)
        self._start_process(wrapping if self.without_bubblewrap is None else [])

    def _wait_until_ready(self) -> bool:
        try:
            _, received = self._receive_answer()
        except (OSError, EOFError):
            self.close()
            return False
        self._folders_inside = received[0]
        return True

    def _start_process(self, wrapping: list[str]) -> None:
        """Start a clean process without our environment."""
        self.close()
        pairs = [socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET) for _ in range(2)]
        worker_ends, zygote_ends = zip(*pairs, strict=True)
        descriptors = [each.fileno() for each in zygote_ends]
        group_prefix = self._group.command_prefix if self._group is not None else []
        arguments = [
            str(_SANDBOX_FOLDER),
            self._role,
            str(self._folders.path),
            " ".join(self._exclusions),
            find_module_folder(self._role),
        ]
        try:
            self._process = subprocess.Popen(
                [*group_prefix, *wrapping, *_build_command(descriptors, arguments)],
                pass_fds=descriptors,
                stdin=subprocess.DEVNULL,
                stdout=subprocess.DEVNULL,
                cwd="/",
                env=_build_environment(),
            )
        finally:
            for each in zygote_ends:
                each.close()
        self._sockets = worker_ends

    def _fork(self, spec: dict[str, Any], descriptors: list[int]) -> tuple[bytes, list[int]]:
        """Fork a child with this spec and these descriptors. Return the zygote's reply."""
        _, specs = self._require_sockets()
        payload = array.array("i", descriptors)
        specs.sendmsg([json.dumps(spec).encode()], [(socket.SOL_SOCKET, socket.SCM_RIGHTS, payload)])
        return self._send_order(0, socket_index=1)

    def _send_order(self, number: int, socket_index: int = 0) -> tuple[bytes, list[int]]:
        """Send an order to the zygote: 0 for a fork, or the child to reap. Return the reply from the socket."""
        self._require_sockets()[0].send(number.to_bytes(4, "little"))
        return self._receive_answer(socket_index)

    def _receive_answer(self, socket_index: int = 0) -> tuple[bytes, list[int]]:
        sockets = self._require_sockets()
        answer_socket, control = sockets[socket_index], sockets[0]
        ready = select.select({answer_socket, control}, [], [], _START_SECONDS)[0]
        if not ready:
            raise EOFError("no answer")
        data, ancillary, _, _ = (answer_socket if answer_socket in ready else control).recvmsg(
            65536, socket.CMSG_SPACE(8 * 4)
        )
        if not data:
            raise EOFError("it ended")
        descriptors = array.array("i")
        for _, _, part in ancillary:
            descriptors.frombytes(part[: len(part) - len(part) % 4])
        return data, list(descriptors)

    def _require_sockets(self) -> tuple[socket.socket, ...]:
        if not self._sockets:
            raise EOFError("it is not running")
        return self._sockets


def _encode_processors(processors: Set[int]) -> str:
    """Return the processors as a bit mask of constant length, because the length of a spec affects addresses."""
    return sum(1 << number for number in processors).to_bytes(_MAX_PROCESSORS // 8, "little").hex()


def _close_descriptors(*descriptors: int) -> None:
    for fd in descriptors:
        os.close(fd)


def _read_pid(pidfd: int) -> int:
    """Return the process id outside the zygote's namespaces, where it may have another number."""
    lines = Path(f"/proc/self/fdinfo/{pidfd}").read_text().splitlines()
    return next(int(line.split()[1]) for line in lines if line.startswith("Pid:"))


def _check_signal(pidfd: int) -> None:
    try:
        signal.pidfd_send_signal(pidfd, 0)
    except OSError as error:
        raise build_missing_error(f"pidfd_send_signal: {error.strerror}") from None


def _build_command(sockets: Sequence[int], arguments: Sequence[str]) -> list[str]:
    """Return the command of a zygote with these two socket descriptors.

    ``arguments`` are its code folder, its role, the parent of private folders, the excluded modules and the import
    folders of its children.
    """
    # Of constant length, because a command's length affects addresses.
    padded_numbers = [f"{number:05}" for number in sockets]
    # -I would ignore the hash seed.
    return [*_FIXED_ADDRESS_COMMAND, *build_python_command("-B", "-c", _START_CODE, *padded_numbers, *arguments)]


def _build_environment() -> dict[str, str]:
    """Return the environment of a zygote, without anything of the worker's. It is the same for all zygotes.

    It fixes hash seeds and numeric kernels, so that their children behave identically.
    """
    return {
        "PATH": "/usr/bin:/bin",
        "LANG": "C.UTF-8",
        "MKL_NUM_THREADS": "1",
        "MALLOC_ARENA_MAX": "2",
        "LOKY_MAX_CPU_COUNT": "1",
        "JOBLIB_MULTIPROCESSING": "0",
        "ORT_DISABLE_TELEMETRY": "1",
        **build_arithmetic_environment(),
    }
