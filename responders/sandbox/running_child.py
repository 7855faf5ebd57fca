"""A child process with student code: communication, limits and termination.

The cause of its end is read from the scheduler's clock and the wait status, never from the child's own data. Callers
set the limits; an assignment's are in ``submissions/assignment/limits.py``.
"""

from __future__ import annotations

import contextlib
import os
import select
import signal
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from responders import packets, wire
from responders.sandbox import child_exit, process_state
from responders.sandbox.meter import ChildStopped, JobMeter
from responders.sandbox.private_folders import FolderLimit
from responders.sandbox.served_child import LibrariesNeeded
from sim.errors import HostError
from sim.recording import Verdict

_POLL_SECONDS = 0.02
#: Bytes per read. Most frames are far shorter.
_READ_BYTES = 8192
#: Minimum CPU seconds charged per frame in either direction, per byte and per action in a packet. They are about the
#: worker's costs, so a child pays for the many or long frames that it sends and for the replies. Calls of the robot's
#: modules use more than that in the child, so these minimums don't change their costs.
_FRAME_CPU_SECONDS, _BYTE_CPU_SECONDS, _ACT_CPU_SECONDS = 1e-5, 1e-8, 5e-6
_STALLED_SECONDS = 5.0
#: Limit for reporting the last place: the child's CPU seconds, and real seconds once it is not runnable.
_LAST_PLACE_CPU_SECONDS = 0.04
_LAST_PLACE_SECONDS = 0.1
#: Maximum number of bytes read while a stopped child reports its last place.
_UNREAD_BYTES = 1 << 20
#: Time for a process to end after it has closed the wire.
_END_SECONDS = 1.0
#: Frames that programs repeat thousands of times; each distinct one is validated once.
_REPEATED_FRAMES = frozenset({"motor_state", "until"})
_MAX_CACHED_FRAMES, _MAX_CACHED_LENGTH = 100, 200


@dataclass(frozen=True, slots=True)
class ChildLimits:
    """Limits of a child: CPU seconds, bytes of memory beyond the interpreter's, modules that it may not import."""

    cpu_seconds: float
    memory_bytes: int
    excluded_modules: tuple[str, ...] = ()


class Child:
    """One forked process with student code. Always call ``close``."""

    def __init__(
        self,
        reap: Callable[[], int],
        pid: int,
        pidfd: int,
        ends: tuple[int, int],
        limits: ChildLimits,
        folder: Path | None,
    ) -> None:
        """Wrap a forked process.

        ``reap`` waits for the end of the child and returns its wait status. ``ends`` are the read and write ends of
        pipes.
        """
        self.sandbox = ""
        self._reap = reap
        self._check_folder: Callable[[], None] = (lambda: None) if folder is None else FolderLimit(folder).check
        self._pid = pid
        self._pidfd = pidfd
        # A round trip over pipes costs little more than half of one over a socket.
        self._reading, self._writing = ends
        self._reply_poll = select.poll()
        self._reply_poll.register(self._reading, select.POLLIN)
        os.set_blocking(self._writing, False)
        self._limits = limits
        self._meter = JobMeter()
        self._is_blamed = self._has_libraries = False
        self._has_overrun: Callable[[], bool] | None = None
        #: ``measured``: the child is watched beyond its limits, which still end it. ``outlasted``: it reached twice its
        #: limit.
        self.measured = self.outlasted = False
        self._pending = b""
        self._sent = self._received = 0  # frames
        self._charged_seconds = 0.0  # seconds, for frames and actions in packets
        self._parsed_frames: dict[bytes, wire.Frame] = {}
        self._closed = False
        self._clock = (~pid << 3) | 2  # the CPU clock of another process, see clock_getcpuclockid(3)
        self._checked = 0.0
        self._waited_seconds = 0.0  # real seconds in which the worker only waited for the child
        self._queued_before = process_state.read_queued_seconds()

    def begin(
        self, meter: JobMeter, is_blamed: bool, has_libraries: bool, has_overrun: Callable[[], bool] | None = None
    ) -> None:
        """Allow student code in the child and charge its costs to ``meter``.

        Args:
            meter: The meter of the job.
            is_blamed: The child counts as the cause if it is killed: it runs alone here and was killed before.
            has_libraries: Libraries are loaded. Otherwise the child may ask for them.
            has_overrun: Returns whether the processes of the submission together exceeded their memory limit.
        """
        self._meter, self._is_blamed, self._has_libraries, self._has_overrun = (
            meter,
            is_blamed,
            has_libraries,
            has_overrun,
        )

    def send(self, frame: dict[str, Any], entries: Sequence[str] = ()) -> None:
        """Send one frame. ``entries`` holds JSON texts. Write errors appear at the next ``receive``."""
        self._send_bytes(wire.encode_frame(frame, self._sent, entries))

    def send_readings(self, units: int, values: Sequence[float]) -> None:
        """Send readings, without arrivals: the time, and the values of all sensors."""
        self._send_bytes(packets.pack_readings(units, values, self._sent))

    def _send_bytes(self, frame: bytes) -> None:
        self._sent += 1
        self._charged_seconds += _FRAME_CPU_SECONDS
        try:
            frame = frame[os.write(self._writing, frame) :]
        except BlockingIOError:
            pass
        except OSError:
            return
        if frame:
            self._send_slowly(frame)

    def _send_slowly(self, frame: bytes) -> None:
        """Send the rest of a frame to a child that has not yet read earlier data."""
        start = time.monotonic()
        while frame:
            select.select([], [self._writing], [], _POLL_SECONDS)
            try:
                frame = frame[os.write(self._writing, frame) :]
            except BlockingIOError:
                self._check_cpu()
                if time.monotonic() - start > _STALLED_SECONDS:
                    raise self._build_stall_stop() from None
            except OSError:
                return
        self._waited_seconds += time.monotonic() - start

    def receive(self, schema: wire.Schema) -> wire.Frame:
        """Return the next frame, charged to the meter if any of its text may be stored.

        Raises:
            ChildStopped: If the child was stopped or has ended.
            LibrariesNeeded: If it has imported a library and none are loaded.
        """
        data = self._pending or self._read_more()
        try:
            if data[0] == packets.PACKET_MARK and "acts" in schema:
                return {"do": "acts", "acts": self._read_actions(data)}
            line, self._pending = self._read_line(data)
            number, line = wire.split_number(line)
            self._check_number(number)
            self._charged_seconds += len(line) * _BYTE_CPU_SECONDS
            frame = self._parsed_frames.get(line)
            if frame is not None:
                return frame
            frame = wire.parse_frame(line, schema)
        except wire.WireError as error:
            # A frame may be invalid because the CPU limit cut it short, which is reported instead.
            self._check_cpu()
            raise ChildStopped(
                Verdict.SANDBOX_VIOLATION, f"the program's process sent {error}, which no allowed call does"
            ) from None
        if frame["do"] == "busy":
            raise child_exit.build_cpu_stop(self._limits.cpu_seconds, frame)
        if frame["do"] == "libraries":
            if self._has_libraries:
                raise ChildStopped(Verdict.SANDBOX_VIOLATION, "its process asked for libraries that it has")
            raise LibrariesNeeded("student code imports a library at run time")
        if frame["do"] not in wire.UNCHARGED_FRAMES:
            self._meter.charge_bytes(len(line))
        elif (
            frame["do"] in _REPEATED_FRAMES
            and len(self._parsed_frames) < _MAX_CACHED_FRAMES
            and len(line) <= _MAX_CACHED_LENGTH
        ):
            self._parsed_frames[line] = frame
        return frame

    def _read_actions(self, data: bytes) -> list[packets.Action]:
        """Return the actions of the packet that begins with ``data``. They are not stored, so no bytes are charged."""
        while len(data) < packets.HEADER_BYTES:
            data += self._read_more()
        size, number = packets.read_header(data)
        if len(data) < size:
            data = self._read_at_least(data, size)
        self._pending = data[size:]
        actions = packets.unpack_actions(data[:size])
        self._check_number(number)
        self._charged_seconds += len(actions) * _ACT_CPU_SECONDS
        return actions

    def _read_at_least(self, data: bytes, size: int) -> bytes:
        """Read until there are at least ``size`` bytes, beginning with ``data``."""
        pieces = [data]
        size -= len(data)
        while size > 0:
            pieces.append(self._read_more())
            size -= len(pieces[-1])
        return b"".join(pieces)

    def _check_number(self, number: int) -> None:
        if number != self._received:
            raise wire.WireError(f"frame {number} where frame {self._received} was due")
        self._received += 1
        self._charged_seconds += _FRAME_CPU_SECONDS

    @property
    def cpu_limit(self) -> float:
        """The limit on the child's CPU seconds."""
        return self._limits.cpu_seconds

    @property
    def is_closed(self) -> bool:
        """Whether the child has been closed."""
        return self._closed

    def measure_cpu_seconds(self) -> float:
        """Return the CPU seconds of the child so far, by the scheduler's clock."""
        try:
            return time.clock_gettime(self._clock)
        except OSError:
            return 0.0

    def stop_and_locate(self) -> wire.Frame:
        """Return the current ``line`` and ``file`` of the child, and stop it: it can't be served afterwards.

        A child that waits for a reply reports the same line in every run. The wait for its report is short.
        """
        with contextlib.suppress(OSError):
            signal.pidfd_send_signal(self._pidfd, signal.SIGXCPU)
        deadline = time.monotonic() + _LAST_PLACE_SECONDS
        cpu_deadline = self.measure_cpu_seconds() + _LAST_PLACE_CPU_SECONDS
        data = self._pending
        while len(data) < _UNREAD_BYTES and self.measure_cpu_seconds() < cpu_deadline:
            if time.monotonic() > deadline and not process_state.is_runnable(self._pid):
                break
            if self._reply_poll.poll(_POLL_SECONDS * 1000):
                new_data = os.read(self._reading, wire.MAX_FRAME_BYTES)
                if not new_data:
                    break
                data += new_data
        return child_exit.parse_location(data)

    def close(self) -> None:
        """Kill the child and wait until it has ended."""
        if self._closed:
            return
        self._kill_and_charge()
        with contextlib.suppress(HostError):
            self._reap()

    def _read_line(self, data: bytes) -> tuple[bytes, bytes]:
        """Return the line that begins with ``data``, and the bytes after it."""
        pieces, size = [data], len(data)
        while b"\n" not in pieces[-1]:
            if size > wire.MAX_FRAME_BYTES:
                raise ChildStopped(Verdict.SANDBOX_VIOLATION, "the program's process sent an endless frame")
            pieces.append(self._read_more())
            size += len(pieces[-1])
        line, _, rest = b"".join(pieces).partition(b"\n")
        return line, rest

    def _read_more(self) -> bytes:
        """Return the next bytes from the child, at least one."""
        last_cpu, idle_start = -1.0, time.monotonic()
        wait_start = idle_start
        while not self._reply_poll.poll(_POLL_SECONDS * 1000):
            now = time.monotonic()
            self._waited_seconds += now - wait_start
            wait_start = now
            self._meter.heartbeat()
            cpu_seconds = self._check_cpu()
            self._check_sleep()
            if cpu_seconds != last_cpu or process_state.is_runnable(self._pid):
                last_cpu, idle_start = cpu_seconds, now
            elif now - idle_start > _STALLED_SECONDS:
                if self.measured:
                    self._watch_beyond_limit(is_computing=False)
                raise self._build_stall_stop()
        now = time.monotonic()
        self._waited_seconds += now - wait_start
        data = os.read(self._reading, _READ_BYTES)
        if not data:
            raise self._explain_end()
        if now - self._checked > _POLL_SECONDS:
            self._checked = now
            self._meter.heartbeat()
            self._check_cpu()
            self._check_sleep()
        return data

    def _check_cpu(self) -> float:
        """Return the CPU seconds used.

        Raises:
            ChildStopped: If they exceed the limit, or the folder has grown too large.
        """
        self._check_folder()
        cpu_seconds = self.measure_cpu_seconds()
        charged_seconds = max(cpu_seconds, self._charged_seconds)
        if charged_seconds > self._limits.cpu_seconds:
            if self.measured:
                self._watch_beyond_limit(is_computing=True)
            raise child_exit.build_cpu_stop(self._limits.cpu_seconds, self.stop_and_locate())
        self._meter.check_cpu(charged_seconds)
        return cpu_seconds

    def _watch_beyond_limit(self, is_computing: bool) -> None:
        """Check whether a child at its limit continues without output up to twice the limit, computing or asleep."""
        cpu_seconds, idle_start = self.measure_cpu_seconds(), time.monotonic()
        with contextlib.suppress(ChildStopped):
            while not self._reply_poll.poll(_POLL_SECONDS * 1000):
                self._meter.heartbeat()
                self._check_folder()
                last_cpu, cpu_seconds = cpu_seconds, self.measure_cpu_seconds()
                is_asleep = time.monotonic() - idle_start > _STALLED_SECONDS
                if cpu_seconds > 2 * self._limits.cpu_seconds or (is_asleep and not is_computing):
                    self.outlasted = True
                    return
                if cpu_seconds == last_cpu and is_asleep:
                    return
                if cpu_seconds != last_cpu:
                    if not is_computing:
                        return
                    idle_start = time.monotonic()

    def _check_sleep(self) -> None:
        """Limit the real time in which neither the child nor the worker ran or waited for a processor.

        No permitted function sleeps in real time, and repeated short sleeps delay the worker. Time in which the worker
        waits for a processor is subtracted, because the child's frames may be unread then.
        """
        slept = self._measure_sleep()
        if slept > 2 * _STALLED_SECONDS:
            raise self._build_stall_stop()
        self._meter.check_sleep(slept)

    def _measure_sleep(self) -> float:
        return max(
            0.0,
            self._waited_seconds
            - process_state.read_busy_seconds(self._pid)
            - (process_state.read_queued_seconds() - self._queued_before),
        )

    def _build_stall_stop(self) -> ChildStopped:
        return ChildStopped(
            Verdict.STALLED,
            f"it did nothing for {_STALLED_SECONDS:g} seconds of real time: it waits for something that never comes",
        )

    def _explain_end(self) -> ChildStopped:
        """Return why a child has closed the wire.

        Raises:
            KilledFromOutside: If neither the worker nor the child ended it.
        """
        cpu_seconds = self.measure_cpu_seconds()
        has_ended = self._has_ended()
        self._kill_and_charge()
        stop = child_exit.explain_exit_status(self._reap(), cpu_seconds, self._limits.cpu_seconds)
        if stop is not None:
            return stop
        has_overrun = has_ended and self._has_overrun is not None and self._has_overrun()
        return child_exit.explain_kill(has_ended, has_overrun, self._is_blamed)

    def _has_ended(self) -> bool:
        """Return whether the child ends within a second: a dying process closes the wire a moment earlier."""
        start = time.monotonic()
        has_ended = bool(select.select([self._pidfd], [], [], _END_SECONDS)[0])
        self._waited_seconds += time.monotonic() - start
        return has_ended

    def _kill_and_charge(self) -> None:
        """Kill the child and report its costs to the meter."""
        self._closed = True
        cpu_seconds, slept = max(self.measure_cpu_seconds(), self._charged_seconds), self._measure_sleep()
        if self.measured:
            # The extra time for measuring is not charged.
            cpu_seconds, slept = min(cpu_seconds, self._limits.cpu_seconds), min(slept, _STALLED_SECONDS)
        self._meter.charge_child(cpu_seconds, slept)
        with contextlib.suppress(OSError):
            signal.pidfd_send_signal(self._pidfd, signal.SIGKILL)
        for fd in (self._reading, self._writing, self._pidfd):
            os.close(fd)
