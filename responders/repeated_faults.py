"""Spares trials a child that would only do again what it did before, up to the same fault.

A child is told a seed, and then nothing but what the worker sends it. So one that uses no chance says the same again
for as long as it is sent the same, and here it is not run but its part is read out; the world, the other children and
the recording are what they always are. What is sent is compared each time, and where it differs the trial is run.

A limit is met again for certain only by a child that is far from passing it: one that has said nothing since half of
its processor time, and does the same at twice its limit. Near the limit every trial is run.
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
#: Faults that cost something, by the role of the child whose they are.
_COSTLY = MappingProxyType({"robot": _LIMITS | {Verdict.PROGRAM_ERROR}, "responder": _LIMITS})
#: What is kept of one child at most, and how often it may be tried in vain.
_MOST_STEPS, _MOST_BYTES = 20_000, 8 << 20
_MOST_MISSES = 3
#: What can be imported without coming near a source of chance; everything else may lead there.
_WITHOUT_CHANCE = frozenset(
    ["collections", "ev3dev2", "ev3dev2_glue", "functools", "itertools", "json", "math", "re", "string", "time"]
)
_IMPORT = re.compile(r"\bfrom\s+([\w.]+)\s+import\b|\bimport\b([^\n;#]*)")
#: Names that chance, or another child's memory, is come to by from there, and ways to write a name that is not seen in
#: the text: escapes, fields of a format, attributes that are copied by their names.
_LEADING_AWAY = re.compile(
    r"\\[xuN0-7\n]|\b(?:v?format(?:_map|_field)?|get_field|Formatter|update_wrapper|wraps|metaclass)\b|\btype\s*\([^)]*,|"
    r"\b(?:_?random|urandom|_?sys|modules|eval|exec|compile|open|getattr|globals|locals|vars|id|hash|inspect"
    r"|(?:gi|cr|ag|tb)_frame|_getframe|f_\w+|__(?!(?:name|main|init|str|repr)__)\w+)\b"
)

#: What a recording notes, by the role of the child that was not run for it.
SPARED = MappingProxyType(
    {
        "robot": "the robot program was not run again in this trial",
        "responder": "the responder was not run again in this trial",
    }
)


class Diverged(RobomarkError):
    """A child was told something else than when its part was written down: the trial has to be run."""


@dataclass(slots=True)
class _Part:
    """What one child was told and what it said, in order; ``whole`` until there was too much of it."""

    first: wire.Frame
    sandbox: str
    steps: list[_Told | _Said] = field(default_factory=list)
    left: int = _MOST_BYTES
    whole: bool = True
    repeats: bool = True  # whether it would come to the same limit again, however fast the machine is

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
    paid: int  # bytes that the job's meter took for it


class RepeatedFaults:
    """Follows the trials of one grading, in the order in which they are run."""

    def __init__(self) -> None:
        self._last: Fault | None = None
        self._heard: list[_Part] = []
        self._known: list[_Part] = []
        self._misses = 0
        self._diverged = False  # whether this trial is run as it cannot be spared
        self._by_heart = False  # whether some child of this trial has not been run

    def child(self, role: str, folder: Path | None, meter: JobMeter | None, spawn: Callable[[], Child]) -> ServedChild:
        """A child of this role, or what stands for it. ``spawn`` makes one."""
        spared = self._last is not None and role.startswith(_role(self._last)) and self._misses < _MOST_MISSES
        if not spared or meter is None or self._diverged:
            return spawn()
        if self._known:
            return _ByHeart(self._known, folder, meter, spawn, self._told_by_heart)
        return _Written(spawn(), folder, meter, self._heard)

    def ran(self, recording: Recording) -> Recording:
        """A trial has ended; its recording, which says so if a child was not run."""
        fault, by_heart = _costly(recording.faults), self._by_heart
        self._by_heart = self._diverged = False
        if by_heart and self._last is not None:
            return replace(recording, notes=(*recording.notes, SPARED[_role(self._last)]))
        if not self._known and fault is not None and self._last is not None and _alike(fault, self._last):
            self._known = [part for part in self._heard if part.whole]
            if not all(part.repeats for part in self._known):
                # So near to the limit that another trial may end otherwise: all are run, and none is measured again.
                self._known, self._misses = [], _MOST_MISSES
        if not self._known:
            self._last = fault
        self._heard = []
        return recording

    def again(self) -> None:
        """The trial is begun anew, as it diverged."""
        self._by_heart, self._diverged = False, True
        self._misses += 1

    def _told_by_heart(self) -> None:
        self._by_heart = True


class _Written:
    """A child whose part is written down."""

    def __init__(self, child: Child, folder: Path | None, meter: JobMeter, parts: list[_Part]) -> None:
        self._child, self._folder, self._meter, self._parts = child, folder, meter, parts
        self._part: _Part | None = None
        self._begun = False
        self._spoke = 0.0  # what it had computed when it last said something, seconds
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
        # What it has left in its folder is looked at later, and would be missing.
        if self._part is not None and not (self._folder and os.path.lexists(self._folder / LOG_FILE)):
            self._parts.append(self._part)
            self._part = None


class _ByHeart:
    """Stands for a child that is told what one was told before; a real one, where none was told that at first."""

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
    """Where a program was when it had computed for too long is another line each time."""
    if one.verdict is Verdict.CPU_LIMIT:
        one, other = (replace(each, line=None, file="") for each in (one, other))
    return one == other


def _without_seed(frame: wire.Frame) -> wire.Frame:
    return {name: value for name, value in frame.items() if name != "seed"}


def _is_alone(frame: wire.Frame) -> bool:
    """Neither a notebook nor one of several agents, who are told things by others."""
    return not frame.keys() & {"cells", "agents", "agent"}


def _may_use_chance(frame: Mapping[str, Any], folder: Path | None) -> bool:
    """Whether a text, or a module that it can import, has anything in it that leads to a source of chance."""
    modules: dict[str, str] = dict(frame.get("modules", {}))
    if folder is not None:
        modules |= {file.stem: file.read_text("utf-8", "replace") for file in folder.glob("*.py")}
    texts = [unicodedata.normalize("NFKC", text) for text in (frame["text"], *modules.values())]
    return any(_LEADING_AWAY.search(text) or not _imports(text) <= _WITHOUT_CHANCE | modules.keys() for text in texts)


def _imports(text: str) -> set[str]:
    """The modules that are imported, and whatever else stands after that word."""
    found = (source or names for source, names in _IMPORT.findall(text))
    return {name.strip().partition(" ")[0].partition(".")[0] for names in found for name in names.split(",")}
