"""Replays a child that failed in earlier trials, instead of running it again up to the same fault.

A child receives a seed and then only data from the worker. A child without randomness therefore repeats its output for
the same input. Its recorded output is replayed; the world, the other children and the recording work as usual. Each
input is compared with the recorded one. If it differs, the trial is run again with a real child.

A processor limit is replayed only if the child would certainly exceed it again. It must have sent nothing since half of
its processor time, and still nothing at twice its limit. Near the limit, every trial is run.
"""

from __future__ import annotations

import os
import re
import unicodedata
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from types import MappingProxyType
from typing import Any

from responders import wire
from responders.logger_file import LOG_FILE
from responders.sandbox.meter import OBJECT_BYTES, ChildStopped, JobMeter
from responders.sandbox.running_child import Child
from responders.sandbox.served_child import ServedChild
from sim.errors import RobomarkError
from sim.recording import Fault, Recording, Verdict

_LIMIT_VERDICTS = frozenset({Verdict.CPU_LIMIT, Verdict.STALLED})
#: Faults that are expensive to repeat, by the role of the child that caused them.
_COSTLY_VERDICTS = MappingProxyType({"robot": _LIMIT_VERDICTS | {Verdict.PROGRAM_ERROR}, "responder": _LIMIT_VERDICTS})
#: Limits on the recorded steps of one child, and on failed attempts to replay it.
_MAX_STEPS, _MAX_BYTES = 20_000, 8 << 20
_MAX_FAILED_REPLAYS = 3
#: Maximum length of the texts that are searched for randomness. Longer ones count as using it.
_MAX_CHARACTERS = 100_000
#: Modules without access to randomness. Any other import may give access to it.
_DETERMINISTIC_MODULES = frozenset(
    ["collections", "ev3dev2", "ev3dev2_glue", "functools", "itertools", "json", "math", "re", "string", "time"]
)
_IMPORT = re.compile(r"\bfrom\s+([\w.]+)\s+import\b|\bimport\b([^\n;#]*)")
#: Names that give access to randomness or to another child's memory, and constructs that can hide a name: escapes,
#: format fields, copied attributes, ``type`` with anything but one plain argument. Student texts are searched with
#: these patterns outside all limits, so the time must be linear in their length.
_UNSAFE_NAMES = re.compile(
    r"\\[xuN0-7\n]|\b(?:v?format(?:_map|_field)?|get_field|Formatter|update_wrapper|wraps|metaclass)\b|\btype\s*+\((?![^(),*]*+\))|"
    r"\b(?:_?random|urandom|_?sys|modules|eval|exec|compile|open|getattr|globals|locals|vars|id|hash|inspect"
    r"|(?:gi|cr|ag|tb)_frame|_getframe|f_\w+|__(?!(?:name|main|init|str|repr)__)\w+)\b"
)

#: Notes for the recording, by the role of the replayed child.
REPLAY_NOTES = MappingProxyType(
    {
        "robot": "the robot program was not run again in this trial",
        "responder": "the responder was not run again in this trial",
    }
)


class ReplayDiverged(RobomarkError):
    """Raised when a child's input differs from the recorded one: the trial has to be run."""


@dataclass(slots=True)
class _ChildRecording:
    """The recorded input and output of one child, in order. ``is_complete`` is False if it grew too large."""

    first: wire.Frame
    sandbox: str
    steps: list[_ChildInput | _ChildOutput] = field(default_factory=list)
    bytes_left: int = _MAX_BYTES
    is_complete: bool = True
    is_repeatable: bool = True  # whether the same limit is certain to be exceeded again

    def add(self, step: _ChildInput | _ChildOutput, size: int) -> None:
        self.bytes_left -= size
        if self.bytes_left < 0 or len(self.steps) >= _MAX_STEPS:
            self.is_complete = False
            self.steps.clear()
        if self.is_complete:
            self.steps.append(step)


@dataclass(frozen=True, slots=True)
class _ChildInput:
    frame: wire.Frame
    arrived: tuple[str, ...]


@dataclass(frozen=True, slots=True)
class _ChildOutput:
    frame_or_stop: wire.Frame | ChildStopped
    bytes_charged: int  # bytes charged to the job's meter


class FaultReplay:
    """Follows the trials of one grading in the order they are run."""

    def __init__(self) -> None:
        self._last: Fault | None = None
        self._new_recordings: list[_ChildRecording] = []
        self._known: list[_ChildRecording] = []
        self._misses = 0
        self._diverged = False  # whether this trial runs real children after a divergence
        self._by_heart = False  # whether a child of this trial was replayed

    def provide_child(
        self, role: str, folder: Path | None, meter: JobMeter | None, spawn: Callable[[], Child]
    ) -> ServedChild:
        """Return a child of this role: a real one from ``spawn``, recorded or not, or a replayed one."""
        is_spared = (
            self._last is not None and role.startswith(_find_role(self._last)) and self._misses < _MAX_FAILED_REPLAYS
        )
        if not is_spared or meter is None or self._diverged:
            return spawn()
        if self._known:
            return _ReplayedChild(self._known, folder, meter, spawn, self._record_replay)
        return _RecordedChild(spawn(), folder, meter, self._new_recordings)

    def record_trial(self, recording: Recording) -> Recording:
        """Record that a trial has ended. Return its recording, with a note if a child was replayed."""
        fault, is_replayed = _find_costly_fault(recording.faults), self._by_heart
        self._by_heart = self._diverged = False
        if is_replayed and self._last is not None:
            return replace(recording, notes=(*recording.notes, REPLAY_NOTES[_find_role(self._last)]))
        if not self._known and fault is not None and self._last is not None and _is_same_failure(fault, self._last):
            self._known = [part for part in self._new_recordings if part.is_complete]
            if not all(part.is_repeatable for part in self._known):
                # Too close to the limit, another trial may end differently. So all trials are run and measuring stops.
                self._known, self._misses = [], _MAX_FAILED_REPLAYS
        if not self._known:
            self._last = fault
        self._new_recordings = []
        return recording

    def record_divergence(self) -> None:
        """Record that the trial diverged and is run again."""
        self._by_heart, self._diverged = False, True
        self._misses += 1

    def _record_replay(self) -> None:
        self._by_heart = True


class _RecordedChild:
    """A real child whose input and output are recorded."""

    def __init__(self, child: Child, folder: Path | None, meter: JobMeter, parts: list[_ChildRecording]) -> None:
        self._child, self._folder, self._meter, self._parts = child, folder, meter, parts
        self._part: _ChildRecording | None = None
        self._has_started = False
        self._spoke = 0.0  # processor seconds at its last frame
        self.sandbox = child.sandbox

    def send(self, frame: wire.Frame, entries: Sequence[str] = ()) -> None:
        self._child.send(frame, entries)
        if self._part is not None:
            self._part.add(_ChildInput(frame, tuple(entries)), sum(map(len, entries)) + len(str(frame)))
        elif not self._has_started and _is_independent(frame) and not _may_use_chance(frame, self._folder):
            self._part = _ChildRecording(_remove_seed(frame), self.sandbox)
            self._child.measured = True
        self._has_started = True

    def send_readings(self, units: int, values: Sequence[float]) -> None:
        self._child.send_readings(units, values)
        if self._part is not None:
            self._part.add(_ChildInput(_build_readings_frame(units, values), ()), 8 * len(values))

    def receive(self, schema: wire.Schema) -> wire.Frame:
        earlier_bytes = self._meter.spent.kept_bytes
        output: wire.Frame | ChildStopped
        try:
            output = self._child.receive(schema)
            if self._part is not None:
                self._spoke = self._child.measure_cpu_seconds()
        except ChildStopped as stop:
            output = stop
            if self._part is not None and stop.verdict in _LIMIT_VERDICTS:
                self._part.is_repeatable = self._child.outlasted and self._spoke < self._child.cpu_limit / 2
        charged_bytes = self._meter.spent.kept_bytes - earlier_bytes
        if self._part is not None:
            self._part.add(_ChildOutput(output, charged_bytes), charged_bytes)
        if isinstance(output, ChildStopped):
            raise output
        return output

    def measure_cpu_seconds(self) -> float:
        return self._child.measure_cpu_seconds()

    def stop_and_locate(self) -> wire.Frame:
        return self._child.stop_and_locate()

    def close(self) -> None:
        self._child.close()
        # A log file is read later and can't be replayed, so such a child isn't.
        if self._part is not None and not (self._folder and os.path.lexists(self._folder / LOG_FILE)):
            self._parts.append(self._part)
            self._part = None


class _ReplayedChild:
    """A replayed child. If no recording starts with the same frame, it runs a real child."""

    def __init__(
        self,
        parts: Sequence[_ChildRecording],
        folder: Path | None,
        meter: JobMeter,
        spawn: Callable[[], Child],
        tell: Callable[[], None],
    ) -> None:
        self._parts, self._folder, self._meter, self._spawn, self._tell = parts, folder, meter, spawn, tell
        self._child: Child | None = None
        self._steps: list[_ChildInput | _ChildOutput] | None = None
        self._next = 0
        self.sandbox = parts[0].sandbox

    def send(self, frame: wire.Frame, entries: Sequence[str] = ()) -> None:
        if self._child is not None:
            self._child.send(frame, entries)
        elif self._steps is None:
            self._start_replay(frame, entries)
        else:
            self._compare_input(_ChildInput(frame, tuple(entries)))

    def send_readings(self, units: int, values: Sequence[float]) -> None:
        if self._child is not None:
            self._child.send_readings(units, values)
        else:
            self._compare_input(_ChildInput(_build_readings_frame(units, values), ()))

    def receive(self, schema: wire.Schema) -> wire.Frame:
        if self._child is not None:
            return self._child.receive(schema)
        step = self._take_step()
        if not isinstance(step, _ChildOutput):
            raise ReplayDiverged("a child was not told something")
        if step.bytes_charged:
            self._meter.charge_bytes(step.bytes_charged - OBJECT_BYTES)
        if isinstance(step.frame_or_stop, ChildStopped):
            raise ChildStopped(
                step.frame_or_stop.verdict, step.frame_or_stop.message, step.frame_or_stop.line, step.frame_or_stop.file
            )
        return step.frame_or_stop

    def measure_cpu_seconds(self) -> float:
        return self._child.measure_cpu_seconds() if self._child is not None else 0.0

    def stop_and_locate(self) -> wire.Frame:
        if self._child is None:
            raise ReplayDiverged("a child that is not run is nowhere")
        return self._child.stop_and_locate()

    def close(self) -> None:
        if self._child is not None:
            self._child.close()

    def _start_replay(self, frame: wire.Frame, entries: Sequence[str]) -> None:
        first_frame = _remove_seed(frame)
        self._steps = next((part.steps for part in self._parts if part.first == first_frame), None)
        if self._steps is not None:
            self._tell()
            return
        self._child = self._spawn()
        self.sandbox = self._child.sandbox
        self._child.send(frame, entries)

    def _compare_input(self, child_input: _ChildInput) -> None:
        if self._take_step() != child_input:
            raise ReplayDiverged("a child was told something new")

    def _take_step(self) -> _ChildInput | _ChildOutput | None:
        assert self._steps is not None
        self._next += 1
        return self._steps[self._next - 1] if self._next <= len(self._steps) else None


def _build_readings_frame(units: int, values: Sequence[float]) -> wire.Frame:
    return {"t": units, "v": list(values)}


def _find_costly_fault(faults: Sequence[Fault]) -> Fault | None:
    return next((each for each in faults if each.verdict in _COSTLY_VERDICTS[_find_role(each)]), None)


def _find_role(fault: Fault) -> str:
    return "responder" if fault.who == "responder" else "robot"


def _is_same_failure(first_fault: Fault, second_fault: Fault) -> bool:
    """Return whether two faults are equal. For the processor limit, the line is ignored because it varies."""
    if first_fault.verdict is Verdict.CPU_LIMIT:
        first_fault, second_fault = (replace(each, line=None, file="") for each in (first_fault, second_fault))
    return first_fault == second_fault


def _remove_seed(frame: wire.Frame) -> wire.Frame:
    return {name: value for name, value in frame.items() if name != "seed"}


def _is_independent(frame: wire.Frame) -> bool:
    """Return whether the child gets data only from the worker: it is not a notebook and has no agents."""
    return not frame.keys() & {"cells", "agents", "agent"}


def _may_use_chance(frame: Mapping[str, Any], folder: Path | None) -> bool:
    """Return whether a text, or a module that it can import, may access a source of randomness."""
    modules: dict[str, str] = dict(frame.get("modules", {}))
    if folder is not None:
        modules |= {file.stem: file.read_text("utf-8", "replace") for file in folder.glob("*.py")}
    texts = [frame["text"], *modules.values()]
    if sum(map(len, texts)) > _MAX_CHARACTERS:
        return True
    texts = list(map(_normalise_characters, texts))
    # Normalising can make a text up to 18 times as long.
    return sum(map(len, texts)) > _MAX_CHARACTERS or any(
        _UNSAFE_NAMES.search(text) or not _find_imports(text) <= _DETERMINISTIC_MODULES | modules.keys()
        for text in texts
    )


def _normalise_characters(text: str) -> str:
    """Return the text with each character in NFKC form, so that an identifier has the spelling that Python reads.

    Normalising a whole text takes quadratic time for long runs of combining marks.
    """
    return text.translate({ord(letter): unicodedata.normalize("NFKC", letter) for letter in set(text)})


def _find_imports(text: str) -> set[str]:
    """Return the imported module names, and any other words that follow ``import``."""
    import_lists = (source or names for source, names in _IMPORT.findall(text))
    return {name.strip().partition(" ")[0].partition(".")[0] for names in import_lists for name in names.split(",")}
