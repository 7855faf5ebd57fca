"""The worker's side of the walls: starts children from a zygote, listens to them, and ends them at their limits.

A child's word is never taken for how it ended: that is read from the scheduler's clock and the wait status.
"""

from __future__ import annotations

import array
import contextlib
import importlib.util
import json
import os
import select
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from types import TracebackType
from typing import Any, Literal

from responders import wire
from sim.errors import HostError
from sim.recording import Verdict

Role = Literal["robot", "responder"]

#: Which layers stand round student code; stamped on every grade.
WALLS = "process limits only"

_POLL_SECONDS = 0.02
_STALLED_SECONDS = 5.0
_START_SECONDS = 60.0
_LAST_WORD_SECONDS = 0.1
#: What a child may send without the world moving on, bytes: a guard against floods that are no prints.
_UNREAD_BYTES = 1 << 20
_FILE_BYTES = 4 << 20
_RECYCLE_AFTER = 1000
#: Frames that a program sends thousands of times to the letter; each is checked once.
_REPEATED = frozenset({"read", "wait", "motor_state", "until"})
_MOST_KNOWN = 100
_FOLDERS = {"robot": ("sim", "brick"), "responder": ("responders", "kit")}


@dataclass(frozen=True, slots=True)
class ChildLimits:
    """CPU seconds and bytes of memory beyond the interpreter's own."""

    cpu_seconds: float
    memory_bytes: int


class ChildStopped(Exception):
    """A child that will say no more: why, in a sentence, and the line of its file where that is known."""

    def __init__(self, verdict: Verdict, message: str, line: int | None = None) -> None:
        super().__init__(message)
        self.verdict, self.message, self.line = verdict, message, line


class Child:
    """One forked process with student code in it. Always ``close`` it."""

    def __init__(self, zygote: Zygote, pid: int, pidfd: int, connection: socket.socket, limits: ChildLimits) -> None:
        self._zygote = zygote
        self._pid = pid
        self._pidfd = pidfd
        self._socket = connection
        self._limits = limits
        self._pending = b""
        self._known: dict[bytes, wire.Frame] = {}
        self._closed = False
        self._clock = (~pid << 3) | 2  # the scheduler's CPU clock of another process, see clock_getcpuclockid(3)
        self._checked = 0.0
        connection.settimeout(_POLL_SECONDS)

    def send(self, frame: dict[str, Any]) -> None:
        """Send one frame; a child that does not read it shows up at the next ``receive``."""
        data = memoryview(wire.encode(frame))
        deadline = time.monotonic() + _STALLED_SECONDS
        while data:
            try:
                data = data[self._socket.send(data) :]
            except TimeoutError:
                self._check_cpu()
                if time.monotonic() > deadline:
                    raise self._stalled() from None
            except OSError:
                return

    def receive(self, schema: wire.Schema, pulse: Callable[[], None]) -> wire.Frame:
        """The next frame; ``pulse`` is called now and then while waiting. Raises ChildStopped."""
        line, newline, rest = self._pending.partition(b"\n")
        if not newline:
            line, rest = self._read_line(pulse)
        self._pending = rest
        frame = self._known.get(line)
        if frame is not None:
            return frame
        try:
            frame = wire.parse(line, schema)
        except wire.WireError as error:
            raise ChildStopped(
                Verdict.SANDBOX_VIOLATION, f"the program's process sent {error}, which no allowed call does"
            ) from None
        if frame["do"] == "busy":
            raise self._too_busy(frame["line"])
        if frame["do"] in _REPEATED and len(self._known) < _MOST_KNOWN:
            self._known[line] = frame
        return frame

    def cpu_seconds(self) -> float:
        """What the child has used so far, by the scheduler's clock."""
        try:
            return time.clock_gettime(self._clock)
        except OSError:
            return 0.0

    def close(self) -> None:
        """Kill the child and wait until it is gone."""
        if self._closed:
            return
        self._closed = True
        self._kill()
        self._socket.close()
        os.close(self._pidfd)
        self._zygote.reap(self._pid)

    def _read_line(self, pulse: Callable[[], None]) -> tuple[bytes, bytes]:
        last_cpu, still_since = -1.0, time.monotonic()
        pieces = [self._pending]
        size = len(self._pending)
        while True:
            try:
                data = self._socket.recv(wire.MOST)
            except TimeoutError:
                pulse()
                used = self._check_cpu()
                if used != last_cpu or self._runnable():
                    last_cpu, still_since = used, time.monotonic()
                elif time.monotonic() - still_since > _STALLED_SECONDS:
                    raise self._stalled() from None
                continue
            except OSError:
                data = b""
            if not data:
                raise self._gone()
            now = time.monotonic()
            if now - self._checked > _POLL_SECONDS:
                self._checked = now
                pulse()
                self._check_cpu()
            pieces.append(data)
            size += len(data)
            if b"\n" in data:
                line, _, rest = b"".join(pieces).partition(b"\n")
                return line, rest
            if size > wire.MOST:
                raise ChildStopped(Verdict.SANDBOX_VIOLATION, "the program's process sent an endless frame")

    def _check_cpu(self) -> float:
        used = self.cpu_seconds()
        if used > self._limits.cpu_seconds:
            raise self._too_busy(self._last_word())
        return used

    def _last_word(self) -> int | None:
        """Ask the child which line it is on, and give it a moment to say so."""
        with contextlib.suppress(OSError):
            signal.pidfd_send_signal(self._pidfd, signal.SIGXCPU)
        deadline = time.monotonic() + _LAST_WORD_SECONDS
        data = self._pending
        while time.monotonic() < deadline and len(data) < _UNREAD_BYTES:
            try:
                more = self._socket.recv(wire.MOST)
            except TimeoutError:
                continue
            except OSError:
                break
            if not more:
                break
            data += more
        for line in reversed(data.splitlines()):
            with contextlib.suppress(wire.WireError):
                frame = wire.parse(line, {"busy": wire.ROBOT["busy"]})
                return None if frame["line"] is None else int(frame["line"])
        return None

    def _too_busy(self, line: int | None) -> ChildStopped:
        return ChildStopped(
            Verdict.CPU_LIMIT,
            f"it computed for more than {self._limits.cpu_seconds:g} seconds of CPU time",
            line,
        )

    def _stalled(self) -> ChildStopped:
        return ChildStopped(
            Verdict.STALLED,
            f"it did nothing for {_STALLED_SECONDS:g} seconds of real time: it waits for something that never comes",
        )

    def _runnable(self) -> bool:
        """Whether the child would run if it got a processor: then a busy machine is to blame, not the program."""
        try:
            state = Path(f"/proc/{self._pid}/stat").read_text().rpartition(")")[2].split()[0]
        except (OSError, IndexError):
            return False
        return state == "R"

    def _gone(self) -> ChildStopped:
        """What the wait status says of a child that has closed the wire."""
        self._kill()
        self._closed = True
        self._socket.close()
        os.close(self._pidfd)
        status = self._zygote.reap(self._pid)
        if os.WIFSIGNALED(status):
            number = os.WTERMSIG(status)
            if number in (signal.SIGXCPU,):
                return self._too_busy(None)
            if number == signal.SIGSYS:
                return ChildStopped(Verdict.SANDBOX_VIOLATION, "it used a system call that is not allowed")
            name = signal.Signals(number).name
            return ChildStopped(Verdict.PROGRAM_ERROR, f"its process crashed ({name})")
        return ChildStopped(Verdict.PROGRAM_ERROR, "its process ended without finishing the program")

    def _kill(self) -> None:
        with contextlib.suppress(OSError):
            signal.pidfd_send_signal(self._pidfd, signal.SIGKILL)


class Zygote:
    """A process with the imports of one role loaded, from which children are forked."""

    def __init__(self, role: Role) -> None:
        self._role = role
        self._forks = 0
        self.children_cpu_seconds = 0.0  # of all children that are gone
        self._control: socket.socket | None = None
        self._process: subprocess.Popen[bytes] | None = None

    def spawn(self, limits: ChildLimits, folder: Path | None = None) -> Child:
        """A fresh child in ``folder``, or with none. Raises HostError when the machine cannot give one."""
        if self._forks >= _RECYCLE_AFTER:
            self.close()
        self._forks += 1
        for attempt in (1, 2):
            try:
                return self._spawn(limits, folder)
            except (OSError, EOFError) as error:
                self.close()
                if attempt == 2:
                    raise HostError(f"the {self._role} zygote does not answer ({error})") from error
        raise AssertionError

    def reap(self, pid: int) -> int:
        """The wait status of a child that has been killed or has ended."""
        try:
            answer, _ = self._ask({"do": "reap", "pid": pid})
            self.children_cpu_seconds += float(answer["cpu"])
            return int(answer["status"])
        except (OSError, EOFError):
            self.close()
            return 0

    def close(self) -> None:
        if self._control is not None:
            self._control.close()
            self._control = None
        if self._process is not None:
            self._process.kill()
            self._process.wait()
            self._process = None
        self._forks = 0

    def _spawn(self, limits: ChildLimits, folder: Path | None) -> Child:
        self._start()
        ours, theirs = socket.socketpair(socket.AF_UNIX, socket.SOCK_STREAM)
        descriptors = [theirs.fileno()]
        if folder is not None:
            descriptors.append(os.open(folder, os.O_RDONLY | os.O_DIRECTORY))
        try:
            answer, received = self._ask(
                {
                    "do": "spawn",
                    "cpu": limits.cpu_seconds,
                    "memory": limits.memory_bytes,
                    "file_size": _FILE_BYTES,
                    "folder": folder is not None,
                },
                descriptors,
            )
        except BaseException:
            ours.close()
            raise
        finally:
            theirs.close()
            for fd in descriptors[1:]:
                os.close(fd)
        return Child(self, answer["pid"], received[0], ours, limits)

    def _start(self) -> None:
        """Exec a clean process, with nothing of ours in its environment, and wait until it has imported."""
        if self._process is not None and self._process.poll() is None:
            return
        self.close()
        ours, theirs = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
        here = Path(__file__).resolve().parent
        package, folder = _FOLDERS[self._role]
        roots = [str(_package_folder(package) / folder)]
        code = (
            "import os, sys; os.dup2(int(sys.argv[1]), 3); os.closerange(4, 1 << 16); sys.path.insert(0, sys.argv[2]); "
            "from inside.zygote import main; main(sys.argv[3], sys.argv[4:])"
        )
        try:
            self._process = subprocess.Popen(
                [sys.executable, "-I", "-B", "-c", code, str(theirs.fileno()), str(here), self._role, *roots],
                pass_fds=(theirs.fileno(),),
                stdin=subprocess.DEVNULL,
                stdout=subprocess.DEVNULL,
                cwd="/",
                env={
                    "PATH": "/usr/bin:/bin",
                    "LANG": "C.UTF-8",
                    "OPENBLAS_NUM_THREADS": "1",
                    "OMP_NUM_THREADS": "1",
                    "MKL_NUM_THREADS": "1",
                    "MALLOC_ARENA_MAX": "2",
                    "LOKY_MAX_CPU_COUNT": "1",
                    "JOBLIB_MULTIPROCESSING": "0",
                    "PYTHONHASHSEED": "0",
                },
            )
        finally:
            theirs.close()
        self._control = ours
        if not select.select([ours], [], [], _START_SECONDS)[0] or not ours.recv(1024):
            self.close()
            raise HostError(f"the {self._role} zygote did not start")

    def _ask(self, order: dict[str, Any], descriptors: list[int] | None = None) -> tuple[dict[str, Any], list[int]]:
        if self._control is None:
            raise EOFError("it is not running")
        payload = array.array("i", descriptors or [])
        ancillary = [(socket.SOL_SOCKET, socket.SCM_RIGHTS, payload)] if descriptors else []
        self._control.sendmsg([json.dumps(order).encode()], ancillary)
        if not select.select([self._control], [], [], _START_SECONDS)[0]:
            raise EOFError("no answer")
        data, received, _, _ = self._control.recvmsg(65536, socket.CMSG_SPACE(8 * 4))
        if not data:
            raise EOFError("it ended")
        found = array.array("i")
        for _, _, part in received:
            found.frombytes(part[: len(part) - len(part) % 4])
        answer: dict[str, Any] = json.loads(data)
        return answer, list(found)


class Sandboxes:
    """The zygotes of one worker: started when first needed, ended together."""

    def __init__(self) -> None:
        self._zygotes: dict[Role, Zygote] = {}

    def spawn(self, role: Role, limits: ChildLimits, folder: Path | None = None) -> Child:
        """A fresh child for a robot program or a responder."""
        if role not in self._zygotes:
            self._zygotes[role] = Zygote(role)
        return self._zygotes[role].spawn(limits, folder)

    @property
    def children_cpu_seconds(self) -> float:
        """What all children that are gone have used."""
        return sum(zygote.children_cpu_seconds for zygote in self._zygotes.values())

    def close(self) -> None:
        while self._zygotes:
            self._zygotes.popitem()[1].close()

    def __enter__(self) -> Sandboxes:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()


def _package_folder(name: str) -> Path:
    specification = importlib.util.find_spec(name)
    assert specification is not None
    assert specification.submodule_search_locations
    return Path(specification.submodule_search_locations[0]).resolve()
