"""No sequence of frames, of any kind or number, makes the worker exceed its budget, hang, or raise.

The frames come from a process that is not a child of a zygote, so it can send anything.
"""

from __future__ import annotations

import json
import os
import pickle
import struct
import subprocess
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from responders import wire
from responders.bridge import Bridge
from responders.channel import Channel
from responders.notebook_executor import PlannedRun, execute_notebook
from responders.notebook_process import NotebookSpec
from responders.responder_process import LoggedData, ResponderProcess
from responders.sandbox import running_child
from responders.sandbox.meter import JobLimits, JobMeter
from responders.sandbox.running_child import Child, ChildLimits
from responders.source_file import SourceFile
from responders.trial_spec import ProgramSpec, ResponderSpec, TrialSpec
from sim.arena import Arena
from sim.camera import Cameras
from sim.floors import build_floor
from sim.recording import Recording
from sim.robot import get_robot
from sim.world import Noise

BUDGET = 60_000
LIMITS = ChildLimits(2.0, 1 << 26)
SECONDS = 2.0


def _texts() -> st.SearchStrategy[str]:
    words = st.sampled_from(
        ["PY::x", "IMG_DATA", "image_data both", "JSON::[[],{}]", "JSON::", "Light_left: 1e999 nan", "\ud800\0", "::"]
    )
    long = st.sampled_from([300, 5000, 60_000]).map(lambda length: "x" * length)
    return st.one_of(words, st.text(max_size=20), long)


def _numbers() -> st.SearchStrategy[Any]:
    edges = st.sampled_from([0, -1, 1, 10**15, 10**16, 1e308, -1e308, 5e-324, 10**400, -0.0])
    return st.one_of(edges, st.integers(), st.floats())


def _anything() -> st.SearchStrategy[Any]:
    return st.one_of(_texts(), _numbers(), st.none(), st.booleans(), st.lists(_numbers(), max_size=3))


def _maybe(strategy: st.SearchStrategy[Any]) -> st.SearchStrategy[Any]:
    return st.one_of(st.none(), strategy)


def _one_of(*words: str) -> st.SearchStrategy[str]:
    return st.sampled_from(words)


#: No more frames are read after these.
_LAST = {"busy", "ready", "end", "stuck", "executed"}
_ERROR = st.fixed_dictionaries({"type": _texts(), "text": _texts(), "line": st.none(), "file": st.none()})
#: Valid values of fields by schema; fields that are not listed contain texts.
_NAMED = {
    "line": _maybe(st.integers(0, 99)),
    "file": _maybe(_one_of("helper.py")),
    "port": _one_of("outB", "outC"),
    "state": _one_of("running", "still"),
    "kind": _one_of("text", "error", "other", "long", "value", "missing"),
    "name": _one_of("sim_magic", "sim_magic_preloaded"),
    "units": st.integers(0, 10**7),
    "timeout": _maybe(st.integers(0, 10**7)),
    "missing": _maybe(_texts()),
    "error": _maybe(_ERROR),
    **{name: st.integers(0, 9) for name in ("depth", "place", "length")},
}


_doubles = st.one_of(st.sampled_from([0.0, 1.0, 2.0, 1e5, 1e15, 1e308, -1e308, -0.0]), st.floats())
_acts = st.one_of(
    st.tuples(st.just(0), st.integers(0, 3), st.just(0), st.just(0), st.sampled_from([1.0, 2.0])),
    st.tuples(st.just(1), st.just(0), st.just(0), st.just(0), st.integers(0, 10**7).map(float)),
    st.tuples(st.just(2), st.integers(0, 1), st.integers(0, 4), st.integers(0, 7), _doubles),
)


@st.composite
def _packets(draw: st.DrawFn) -> bytes:
    """Draw a packet of acts, mostly valid ones, with space for its number."""
    acts = [struct.pack("<BBBBd", *act) for act in draw(st.lists(_acts, max_size=6))] * draw(
        st.sampled_from([1, 1, 300])
    )
    if draw(st.integers(0, 19)) == 0:
        acts.append(draw(st.binary(min_size=12, max_size=12)))
    return struct.pack("<BxHxxxxQ", 0, len(acts), 0) + b"".join(acts)


@st.composite
def _frames(draw: st.DrawFn, schema: wire.Schema) -> bytes:
    """Draw a frame: mostly a valid one, sometimes an invalid one, sometimes bytes that are not a frame."""
    how = draw(st.integers(0, 39))
    if how == 0:
        return draw(st.binary(max_size=100))
    last = draw(st.integers(0, 9)) == 0
    do = draw(st.sampled_from(sorted(schema if last else schema.keys() - _LAST)))
    if do == "acts" or how == 2:
        return draw(_packets())
    required, optional = schema[do]
    names = [*required, *draw(st.lists(st.sampled_from(sorted(optional)), unique=True) if optional else st.just([]))]
    frame = {"do": do} | {
        name: draw(_anything() if how == 1 else _NAMED.get(f"{do} {name}", _NAMED.get(name, _texts())))
        for name in names
    }
    return json.dumps(frame).encode()


def _sequences(schema: wire.Schema) -> st.SearchStrategy[list[bytes]]:
    """Return frames, each repeated a number of times."""
    repeated = st.tuples(_frames(schema), st.sampled_from([1, 1, 2, 40, 400]))
    return st.lists(repeated, min_size=1, max_size=12).map(lambda runs: [frame for frame, n in runs for _ in range(n)])


@contextmanager
def _child(frames: list[bytes], folder: Path, meter: JobMeter) -> Iterator[Child]:
    """Start a process that writes these frames with correct numbers and reads nothing."""
    reading, their_writing = os.pipe()
    their_reading, writing = os.pipe()
    with tempfile.TemporaryFile() as file:
        for number, frame in enumerate(frames):
            file.write(_numbered(frame, number))
        file.seek(0)
        process = subprocess.Popen(["cat"], stdin=file, stdout=their_writing)
    # It reads nothing and does not end.
    ears = subprocess.Popen(["cat"], stdin=their_reading, stdout=subprocess.DEVNULL, pass_fds=[their_writing])
    for fd in (their_writing, their_reading):
        os.close(fd)
    ends = reading, writing
    child = Child(lambda: _status(process), process.pid, os.pidfd_open(process.pid), ends, LIMITS, folder)
    child.begin(meter, is_blamed=True, has_libraries=True)
    try:
        yield child
    finally:
        child.close()
        ears.wait()


def _numbered(frame: bytes, number: int) -> bytes:
    if frame.startswith(b"{"):
        return b'{"n":%d,' % number + frame[1:] + b"\n"
    if frame.startswith(b"\0"):
        return frame[:8] + number.to_bytes(8, "little") + frame[16:]
    return frame + b"\n"


def _status(process: subprocess.Popen[bytes]) -> int:
    status = process.wait()
    return status << 8 if status >= 0 else -status


@pytest.fixture(autouse=True)
def _impatient(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(running_child, "_STALLED_SECONDS", 0.1)
    monkeypatch.setattr(running_child, "_FRAME_CPU_SECONDS", 1e-4)


def test_frames_in_both_directions_are_charged(tmp_path: Path) -> None:
    meter, count = JobMeter(), 200
    with _child([b'{"do":"until_said"}'] * count, tmp_path, meter) as child:
        for _ in range(count):
            child.receive(wire.ROBOT)
            child.send({"t": 0, "v": None})
        for _ in range(count):
            child.send_readings(0, [0.0])
    assert meter.spent.cpu_seconds >= 3 * count * running_child._FRAME_CPU_SECONDS


class _Sandboxes:
    """Returns the processes that a test has created."""

    def __init__(self, folder: Path, *children: Child) -> None:
        self._folder, self._children = folder, list(children)

    def spawn(self, *_: object, **__: object) -> Child:
        return self._children.pop(0)

    @contextmanager
    def open_private_folder(self) -> Iterator[Path]:
        yield self._folder


@pytest.fixture(scope="module")
def ground() -> Iterator[tuple[Arena, Any]]:
    cameras, arena = Cameras(), Arena(())
    yield arena, cameras.open_camera(build_floor("Empty_Map").pixels)
    arena.close()
    cameras.close()


def _spec() -> TrialSpec:
    program = ProgramSpec(SourceFile("robot.py", ""), "none", LIMITS, 1 << 40)
    ground = build_floor("Empty_Map")
    noise, channel = Noise(), Channel()
    return TrialSpec(
        program, None, True, ground, get_robot("Default_Robot"), ground.default_pose, noise, channel, SECONDS, 1, 1
    )


@pytest.mark.long
@given(frames=_sequences(wire.ROBOT))
@settings(max_examples=60)
def test_of_a_robot_program(
    frames: list[bytes], ground: tuple[Arena, Any], tmp_path_factory: pytest.TempPathFactory
) -> None:
    meter = JobMeter(JobLimits(kept_bytes=BUDGET))
    with _child(frames, tmp_path_factory.mktemp("folder"), meter) as child:
        bridge = Bridge(_spec(), *ground, child, None, meter)
        fault = bridge.run()
    assert fault is None or not fault.staff, fault
    kept = (bridge.printed, bridge.spoken, bridge.images, bridge.image_log, bridge.notes, bridge.conversation.messages)
    assert len(pickle.dumps((kept, fault))) < 2 * BUDGET


@pytest.mark.long
@given(frames=_sequences(wire.RESPONDER))
@settings(max_examples=60)
def test_of_a_responder(frames: list[bytes], tmp_path_factory: pytest.TempPathFactory) -> None:
    meter = JobMeter(JobLimits(kept_bytes=BUDGET))
    folder = tmp_path_factory.mktemp("folder")
    with _child([b'{"do":"ready","error":null}', *frames], folder, meter) as child:
        spec = ResponderSpec(SourceFile("responder.py", ""), {}, LIMITS, 1 << 40)
        responder = ResponderProcess(spec, _Sandboxes(folder, child), folder, 1, meter)  # type: ignore[arg-type]
        faults = [responder.load()]
        faults += [
            responder.answer("PY::x", n, n, LoggedData()).fault for n in range(len(frames)) if responder.is_alive
        ]
    assert not any(fault.staff for fault in faults if fault is not None), faults
    assert len(pickle.dumps((responder.output, responder.calls, responder.notes, faults))) < 2 * BUDGET


class _NoRuns:
    """A notebook environment in which no call starts a robot."""

    def plan_standstill(self) -> PlannedRun:
        return PlannedRun(_spec())

    def plan_call(self, call: object) -> PlannedRun:
        return PlannedRun(notes=("noted",))

    def record_run(self, recording: Recording) -> None:
        raise AssertionError

    def plan_last_run(self) -> PlannedRun:
        return PlannedRun()


@pytest.mark.long
@given(frames=_sequences(wire.NOTEBOOK))
@settings(max_examples=60)
def test_of_a_notebook(
    frames: list[bytes], ground: tuple[Arena, Any], tmp_path_factory: pytest.TempPathFactory
) -> None:
    meter = JobMeter(JobLimits(kept_bytes=BUDGET))
    folder = tmp_path_factory.mktemp("folder")
    with _child(frames, folder, meter) as child:
        spec = NotebookSpec("n.ipynb", ("pass", "pass"), {}, LIMITS, 1 << 40, 1)
        executed = execute_notebook(spec, _NoRuns(), lambda *_: ground, _Sandboxes(folder, child), meter)  # type: ignore[arg-type]
    assert executed.stopped is None or not executed.stopped.staff, executed.stopped
    assert len(pickle.dumps(executed)) < 2 * BUDGET
