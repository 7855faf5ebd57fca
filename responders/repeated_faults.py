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
from responders.sandbox.running_child import Child, ServedChild
from sim.errors import RobomarkError
from sim.recording import Fault, Recording, Verdict

_LIMITS = frozenset({Verdict.CPU_LIMIT, Verdict.STALLED})
#: Faults that are expensive to repeat, by the role of the child that caused them.
_COSTLY = MappingProxyType({"robot": _LIMITS | {Verdict.PROGRAM_ERROR}, "responder": _LIMITS})
#: Limits on the recorded steps of one child, and on failed attempts to replay it.
_MOST_STEPS, _MOST_BYTES = 20_000, 8 << 20
_MOST_MISSES = 3
#: Modules without access to randomness. Any other import may give access to it.
_WITHOUT_CHANCE = frozenset(
    ["collections", "ev3dev2", "ev3dev2_glue", "functools", "itertools", "json", "math", "re", "string", "time"]
)
_IMPORT = re.compile(r"\bfrom\s+([\w.]+)\s+import\b|\bimport\b([^\n;#]*)")
#: Names that give access to randomness or to another child's memory, and constructs that can hide a name: escapes,
#: format fields, copied attributes.
_LEADING_AWAY = re.compile(
    r"\\[xuN0-7\n]|\b(?:v?format(?:_map|_field)?|get_field|Formatter|update_wrapper|wraps|metaclass)\b|\btype\s*\([^)]*,|"
    r"\b(?:_?random|urandom|_?sys|modules|eval|exec|compile|open|getattr|globals|locals|vars|id|hash|inspect"
    r"|(?:gi|cr|ag|tb)_frame|_getframe|f_\w+|__(?!(?:name|main|init|str|repr)__)\w+)\b"
)

#: Notes for the recording, by the role of the replayed child.
SPARED = MappingProxyType(
    {
        "robot": "the robot program was not run again in this trial",
        "responder": "the responder was not run again in this trial",
    }
)


class Diverged(RobomarkError):
    """Raised when a child's input differs from the recorded one: the trial has to be run."""


@dataclass(slots=True)
class _Part:
    """The recorded input and output of one child, in order. ``whole`` is False if it grew too large."""

    first: wire.Frame
    sandbox: str
    steps: list[_Told | _Said] = field(default_factory=list)
    left: int = _MOST_BYTES
    whole: bool = True
    repeats: bool = True  # whether the same limit is certain to be exceeded again

    def add(self, step: _Told | _Said, size: int) -> None:
        self.left -= size
        if self.left < 0 or len(self.steps) >= _MOST_STEPS:
            self.whole = False
            self.steps.clear()
        if self.whole:
            self.steps.append(step)


@dataclass(frozen=True, slots=True)
class _Told:
    frame: wire.Frame
    arrived: tuple[str, ...]


@dataclass(frozen=True, slots=True)
class _Said:
    what: wire.Frame | ChildStopped
    paid: int  # bytes charged to the job's meter


class RepeatedFaults:
    """Follows the trials of one grading in the order they are run."""

    def __init__(self) -> None:
        self._last: Fault | None = None
        self._heard: list[_Part] = []
        self._known: list[_Part] = []
        self._misses = 0
        self._diverged = False  # whether this trial runs real children after a divergence
        self._by_heart = False  # whether a child of this trial was replayed

    def child(self, role: str, folder: Path | None, meter: JobMeter | None, spawn: Callable[[], Child]) -> ServedChild:
        """Return a child of this role: a real one from ``spawn``, recorded or not, or a replayed one."""
        spared = self._last is not None and role.startswith(_role(self._last)) and self._misses < _MOST_MISSES
        if not spared or meter is None or self._diverged:
            return spawn()
        if self._known:
            return _ByHeart(self._known, folder, meter, spawn, self._told_by_heart)
        return _Written(spawn(), folder, meter, self._heard)

    def ran(self, recording: Recording) -> Recording:
        """Record that a trial has ended. Return its recording, with a note if a child was replayed."""
        fault, by_heart = _costly(recording.faults), self._by_heart
        self._by_heart = self._diverged = False
        if by_heart and self._last is not None:
            return replace(recording, notes=(*recording.notes, SPARED[_role(self._last)]))
        if not self._known and fault is not None and self._last is not None and _alike(fault, self._last):
            self._known = [part for part in self._heard if part.whole]
            if not all(part.repeats for part in self._known):
                # Too close to the limit, another trial may end differently. So all trials are run and measuring stops.
                self._known, self._misses = [], _MOST_MISSES
        if not self._known:
            self._last = fault
        self._heard = []
        return recording

    def again(self) -> None:
        """Record that the trial diverged and is run again."""
        self._by_heart, self._diverged = False, True
        self._misses += 1

    def _told_by_heart(self) -> None:
        self._by_heart = True


class _Written:
    """A real child whose input and output are recorded."""

    def __init__(self, child: Child, folder: Path | None, meter: JobMeter, parts: list[_Part]) -> None:
        self._child, self._folder, self._meter, self._parts = child, folder, meter, parts
        self._part: _Part | None = None
        self._begun = False
        self._spoke = 0.0  # processor seconds at its last frame
        self.sandbox = child.sandbox

    def send(self, frame: wire.Frame, arrived: Sequence[str] = ()) -> None:
        self._child.send(frame, arrived)
        if self._part is not None:
            self._part.add(_Told(frame, tuple(arrived)), sum(map(len, arrived)) + len(str(frame)))
        elif not self._begun and _is_alone(frame) and not _may_use_chance(frame, self._folder):
            self._part = _Part(_without_seed(frame), self.sandbox)
            self._child.measured = True
        self._begun = True

    def send_readings(self, units: int, values: Sequence[float]) -> None:
        self._child.send_readings(units, values)
        if self._part is not None:
            self._part.add(_Told(_readings(units, values), ()), 8 * len(values))

    def receive(self, schema: wire.Schema) -> wire.Frame:
        before = self._meter.spent.kept_bytes
        said: wire.Frame | ChildStopped
        try:
            said = self._child.receive(schema)
            if self._part is not None:
                self._spoke = self._child.cpu_seconds()
        except ChildStopped as stop:
            said = stop
            if self._part is not None and stop.verdict in _LIMITS:
                self._part.repeats = self._child.outlasted and self._spoke < self._child.cpu_limit / 2
        paid = self._meter.spent.kept_bytes - before
        if self._part is not None:
            self._part.add(_Said(said, paid), paid)
        if isinstance(said, ChildStopped):
            raise said
        return said

    def cpu_seconds(self) -> float:
        return self._child.cpu_seconds()

    def last_place(self) -> wire.Frame:
        return self._child.last_place()

    def close(self) -> None:
        self._child.close()
        # A log file is read later and can't be replayed, so such a child isn't.
        if self._part is not None and not (self._folder and os.path.lexists(self._folder / LOG_FILE)):
            self._parts.append(self._part)
            self._part = None


class _ByHeart:
    """A replayed child. If no recording starts with the same frame, it runs a real child."""

    def __init__(
        self,
        parts: Sequence[_Part],
        folder: Path | None,
        meter: JobMeter,
        spawn: Callable[[], Child],
        tell: Callable[[], None],
    ) -> None:
        self._parts, self._folder, self._meter, self._spawn, self._tell = parts, folder, meter, spawn, tell
        self._child: Child | None = None
        self._steps: list[_Told | _Said] | None = None
        self._next = 0
        self.sandbox = parts[0].sandbox

    def send(self, frame: wire.Frame, arrived: Sequence[str] = ()) -> None:
        if self._child is not None:
            self._child.send(frame, arrived)
        elif self._steps is None:
            self._begin(frame, arrived)
        else:
            self._compare(_Told(frame, tuple(arrived)))

    def send_readings(self, units: int, values: Sequence[float]) -> None:
        if self._child is not None:
            self._child.send_readings(units, values)
        else:
            self._compare(_Told(_readings(units, values), ()))

    def receive(self, schema: wire.Schema) -> wire.Frame:
        if self._child is not None:
            return self._child.receive(schema)
        step = self._step()
        if not isinstance(step, _Said):
            raise Diverged("a child was not told something")
        if step.paid:
            self._meter.keep(step.paid - OBJECT_BYTES)
        if isinstance(step.what, ChildStopped):
            raise ChildStopped(step.what.verdict, step.what.message, step.what.line, step.what.file)
        return step.what

    def cpu_seconds(self) -> float:
        return self._child.cpu_seconds() if self._child is not None else 0.0

    def last_place(self) -> wire.Frame:
        if self._child is None:
            raise Diverged("a child that is not run is nowhere")
        return self._child.last_place()

    def close(self) -> None:
        if self._child is not None:
            self._child.close()

    def _begin(self, frame: wire.Frame, arrived: Sequence[str]) -> None:
        first = _without_seed(frame)
        self._steps = next((part.steps for part in self._parts if part.first == first), None)
        if self._steps is not None:
            self._tell()
            return
        self._child = self._spawn()
        self.sandbox = self._child.sandbox
        self._child.send(frame, arrived)

    def _compare(self, told: _Told) -> None:
        if self._step() != told:
            raise Diverged("a child was told something new")

    def _step(self) -> _Told | _Said | None:
        assert self._steps is not None
        self._next += 1
        return self._steps[self._next - 1] if self._next <= len(self._steps) else None


def _readings(units: int, values: Sequence[float]) -> wire.Frame:
    return {"t": units, "v": list(values)}


def _costly(faults: Sequence[Fault]) -> Fault | None:
    return next((each for each in faults if each.verdict in _COSTLY[_role(each)]), None)


def _role(fault: Fault) -> str:
    return "responder" if fault.who == "responder" else "robot"


def _alike(one: Fault, other: Fault) -> bool:
    """Return whether two faults are equal. For the processor limit, the line is ignored because it varies."""
    if one.verdict is Verdict.CPU_LIMIT:
        one, other = (replace(each, line=None, file="") for each in (one, other))
    return one == other


def _without_seed(frame: wire.Frame) -> wire.Frame:
    return {name: value for name, value in frame.items() if name != "seed"}


def _is_alone(frame: wire.Frame) -> bool:
    """Return whether the child gets data only from the worker: it is no notebook and has no agents."""
    return not frame.keys() & {"cells", "agents", "agent"}


def _may_use_chance(frame: Mapping[str, Any], folder: Path | None) -> bool:
    """Return whether a text, or a module that it can import, may access a source of randomness."""
    modules: dict[str, str] = dict(frame.get("modules", {}))
    if folder is not None:
        modules |= {file.stem: file.read_text("utf-8", "replace") for file in folder.glob("*.py")}
    texts = [unicodedata.normalize("NFKC", text) for text in (frame["text"], *modules.values())]
    return any(_LEADING_AWAY.search(text) or not _imports(text) <= _WITHOUT_CHANCE | modules.keys() for text in texts)


def _imports(text: str) -> set[str]:
    """Return the imported module names, and any other words that follow ``import``."""
    found = (source or names for source, names in _IMPORT.findall(text))
    return {name.strip().partition(" ")[0].partition(".")[0] for names in found for name in names.split(",")}
