"""Runs one robot program, now, in a simulator set up by the magic's flags, and shows what happened. No marks.

What can be said to it is ``run.py``'s; a notebook is run by ``run_notebook.py``.
"""

from __future__ import annotations

import json
import stat
import sys
from collections.abc import Mapping, Set
from dataclasses import replace
from pathlib import Path
from typing import Any

from models import weights_bytes
from responders.channel import Channel
from responders.code import Code
from responders.sandbox.manager import Sandboxes
from responders.sandbox.meter import JobLimits, JobMeter
from responders.sandbox.running_child import ChildLimits
from responders.sandbox.zygote import FULL, NONE
from responders.trial_spec import PartnerSpec, ProgramSpec, ResponderSpec, TrialSpec
from service.commands.channel_flags import changed
from service.commands.run_notebook import LastRun, RunLimits, run_notebook, show_diagrams, show_notebook
from service.commands.shown import document, note, tell
from service.commands.unsafe import warn_of_no_sandbox
from service.grading.grade import TrialResult
from service.grading.trial_runner import TrialRunner
from service.home import for_the_user
from service.reports.plots.path import draw_path
from service.reports.plots.style import png
from service.reports.readable import readable
from service.reports.replay.document import Pixels, replay_of_run
from service.reports.replay.sources import Sources, sources_of_cells, sources_of_files
from service.reports.robots import robots_of
from service.reports.trace import storable, trace
from service.reports.transcript import transcript
from service.reports.view import NO_OTHERS, OtherTrials
from service.reports.written import prepare_folder, write_film, write_replay
from sim.errors import UsageError
from sim.floors import Floor, floor, floor_from_image, names
from sim.recorded import faults_of, floor_of
from sim.recording import Recording
from sim.robot import robot
from sim.world import Noise
from submissions.helper_modules import modules_of
from submissions.magics import Flags, setup, split_program
from submissions.notebook import is_script, read_notebook, read_script
from submissions.source_text import decode_source
from submissions.submission import Notebook

_PROGRAM = ChildLimits(5.0, 128 << 20)
_RESPONDER_MEMORY = 512 << 20
_ALL_CPU = 150.0  # of all processes together, beside what the responder may compute
_OUTPUT_BYTES = 1_000_000
_IMAGES = (".png", ".jpg", ".jpeg")
_FILES_BYTES = 16 << 20
_NETWORKS = {"mlp_shapes_14x14.joblib": "shapes"}


def run_program(
    program: Path,
    values: Mapping[str, str | None],
    switches: Set[str],
    given: Mapping[str, object],
    *,
    responder: str | None,
    second: Path | None,
    responder_cpu: float,
    seconds: float,
    seed: int,
    sheet: int | None,
    replay: Path | None,
    over: Path | None,
    film: Path | None,
    trace_file: Path | None,
    image: Path | None,
    diagrams: Path | None,
    unsafe: bool,
) -> None:
    """Run it with these flags of the magic, by their letters, and of the channel; show what happened."""
    if diagrams is not None:
        prepare_folder(diagrams)
    own = _own_floor(values["b"])
    values = {**values, "b": values["b"] if own is None else None}
    channel = changed(Channel(), given)
    wanted = Flags(switches=frozenset(switches)).with_values(**values)
    if unsafe:
        warn_of_no_sandbox()
    allowed = ChildLimits(responder_cpu, _RESPONDER_MEMORY)
    meter = JobMeter(JobLimits(cpu_seconds=_ALL_CPU + responder_cpu))
    notebook = _notebook(program)
    if notebook is not None:
        if responder is not None:
            raise UsageError(f"{program.name} is a notebook and answers the robot itself; leave --responder out")
        if second is not None:
            raise UsageError(f"{program.name} is a notebook and starts its robots itself; leave --second out")
        if over is not None:
            raise UsageError(f"{program.name} is a notebook, which no other program is run over; leave --over out")
        last = LastRun(wanted, seed, seed if sheet is None else sheet, channel, own)
        limits = RunLimits(allowed, _PROGRAM, _OUTPUT_BYTES, seconds)
        with TrialRunner(Sandboxes(NONE if unsafe else FULL)) as runner:
            text = "\n".join(cell.source for cell in notebook.cells)
            executed = run_notebook(notebook, _files_beside(program, text), limits, last, runner, meter)
        runs = [{"cell": run.cell, **_told(run.recording)} for run in executed.runs]
        document(output=executed.output, runs=runs, notes=executed.notes, stopped=executed.stopped)
        show_notebook(executed, _show)
        show_diagrams(notebook, diagrams)
        if executed.runs:
            recording = executed.runs[-1].recording
            _keep(recording, program.name, seed, trace_file, image, film, own)
            _keep_replay(replay, recording, program.name, seed, sources_of_cells(notebook), own)
        return
    if diagrams is not None:
        raise UsageError(f"{program.name} is not a notebook and draws no diagrams; leave --diagrams out")
    flags, text = _program(program)
    flags = Flags(flags.preamble, flags.values | wanted.values, flags.switches | wanted.switches)
    flags = flags if own is None else flags.without("b")
    chosen = setup(flags)
    spec = TrialSpec(
        program=_program_spec(program, flags, text),
        responder=_responder(responder, allowed),
        collaborative=chosen.collaborative or responder is not None or second is not None,
        floor=own or floor(chosen.background, seed=seed if sheet is None else sheet),
        robot=robot(chosen.robot),
        pose=chosen.pose,
        noise=Noise(chosen.light_noise, chosen.motor_noise),
        channel=channel,
        seconds=seconds,
        seed=seed,
        child_seed=seed,
        pen_down=chosen.pen_down,
        partner=_partner(second),
    )
    other = None if over is None else _other_program(over)
    for each in chosen.notes:
        note(f"note: {each}")
    with TrialRunner(Sandboxes(NONE if unsafe else FULL)) as runner:
        recording = runner.run(spec, chosen.obstacles, meter)
        others = NO_OTHERS
        if other is not None:
            beside = runner.run(replace(spec, program=other), chosen.obstacles, meter)
            others = OtherTrials(other.code.name, {0: _as_trial(beside, seed)})
    document(run=_told(recording), notes=chosen.notes)
    _show(recording)
    _keep(recording, program.name, seed, trace_file, image, film, own)
    answering = None if spec.responder is None else spec.responder.code
    _keep_replay(replay, recording, program.name, seed, sources_of_files(spec.program.code, answering), own, others)


def _other_program(path: Path) -> ProgramSpec:
    """A program that is run in the first one's world, whatever its own first line says of one."""
    if _notebook(path) is not None:
        raise UsageError(f"--over {path.name} is a notebook, expected a robot program")
    return _program_spec(path, *_program(path))


def _program_spec(path: Path, flags: Flags, text: str) -> ProgramSpec:
    return ProgramSpec(Code(path.name, text), flags.preamble, _PROGRAM, _OUTPUT_BYTES, _modules_beside(path, text))


def _partner(second: Path | None) -> PartnerSpec | None:
    """The second robot, as the first line of its program says."""
    if second is None:
        return None
    flags, text = _program(second)
    if not {"x", "y"} <= flags.values.keys():
        raise UsageError(f"{second.name}: does not say where the second robot starts; expected -x and -y in line 1")
    chosen = setup(flags)
    program = ProgramSpec(Code(second.name, text), flags.preamble, _PROGRAM, _OUTPUT_BYTES)
    return PartnerSpec(program, chosen.pose, chosen.pen_down)


def _own_floor(background: str | None) -> Floor | None:
    """The floor that an image file is; None where a floor is named."""
    path = Path(background or "")
    if background in names() or path.suffix.lower() not in _IMAGES:
        return None
    return floor_from_image(path.name, _read(path))


def _keep(
    recording: Recording,
    name: str,
    seed: int,
    trace_file: Path | None,
    image: Path | None,
    film: Path | None,
    own: Floor | None,
) -> None:
    if trace_file is not None:
        _write(trace_file, json.dumps(trace(recording)).encode())
    if image is not None:
        _write(image, _drawn(recording, name, seed, own))
    if film is not None:
        write_film(film, _as_trial(recording, seed), _own_pixels(own))


def _keep_replay(
    path: Path | None,
    recording: Recording,
    name: str,
    seed: int,
    sources: Sources,
    own: Floor | None,
    others: OtherTrials = NO_OTHERS,
) -> None:
    if path is not None:
        write_replay(path, replay_of_run(recording, name, seed, sources, _own_pixels(own), others))


def _own_pixels(own: Floor | None) -> dict[str, Pixels]:
    return {} if own is None else {own.name: own.pixels}


def _as_trial(recording: Recording, seed: int) -> TrialResult:
    return TrialResult("run", 0, seed, 0, 0, "visible", recording)


def _notebook(path: Path) -> Notebook | None:
    """The notebook in a file, or that nbconvert has made a file of; None if it is a robot program."""
    if path.suffix.lower() == ".ipynb":
        read = read_notebook(_read(path), path.name)
        for each in read.notes:
            note(f"note: {each}")
        return read.notebook
    text = _source(path)
    return read_script(text, path.name) if is_script(text) else None


def _program(path: Path) -> tuple[Flags, str]:
    text = _source(path)
    try:
        return split_program(text)
    except UsageError as error:
        raise UsageError(f"{path.name}: {error}") from None


def _source(path: Path) -> str:
    return decode_source(_read(path), path.name).text


def _read(path: Path) -> bytes:
    try:
        if not stat.S_ISREG(path.stat().st_mode):
            raise UsageError(f"{path} is not a file; expected one that can be read")
        return path.read_bytes()
    except OSError as error:
        raise UsageError(f"{path} cannot be read: {error.strerror}") from error


def _write(path: Path, data: bytes) -> None:
    try:
        with for_the_user():
            path.write_bytes(data)
    except OSError as error:
        raise UsageError(f"{path} cannot be written: {error.strerror}") from error


def _responder(given: str | None, limits: ChildLimits) -> ResponderSpec | None:
    """FILE or FILE:NAME, with the files beside it, and the course's networks unless it brings its own."""
    if given is None:
        return None
    path, name = Path(given), None
    if not path.exists() and ":" in given:
        file, _, name = given.rpartition(":")
        path = Path(file)
    text = _source(path)
    return ResponderSpec(Code(path.name, text), _files_beside(path, text), limits, _OUTPUT_BYTES, name)


def _modules_beside(path: Path, text: str) -> Mapping[str, str]:
    """What a file with this text imports from its folder."""

    def read(name: str) -> bytes | None:
        beside = path.parent / name
        if beside.is_symlink() or not beside.is_file() or name == path.name:
            return None
        return beside.read_bytes()

    return modules_of(text, read)


def _files_beside(path: Path, text: str) -> dict[str, bytes]:
    files = {file: weights_bytes(model) for file, model in _NETWORKS.items()}
    files |= {f"{name}.py": module.encode() for name, module in _modules_beside(path, text).items()}
    left = _FILES_BYTES
    for beside in sorted(path.parent.iterdir()):
        if beside.suffix in (".py", ".ipynb", "") or beside.is_symlink() or not beside.is_file():
            continue
        left -= beside.stat().st_size
        if left >= 0:
            files[beside.name] = beside.read_bytes()
    return files


def _show(recording: Recording) -> None:
    """What was printed, spoken, answered and heard, in order, and how it ended."""
    for t, text in transcript(recording):
        tell(f"{t:8.2f} s  {readable(text, 400)}")
    for which, own in robots_of(recording):
        end, whose = own.end, "" if own is recording else f"{which}: "
        tell(
            f"{own.end_t:8.2f} s  {whose}end at x {end.x:.1f} mm, y {end.y:.1f} mm, heading {end.heading:.1f} degrees; "
            f"{own.verdict}"
        )
    for fault in faults_of(recording):
        whose = "" if fault.file else f" of the {fault.who}"
        where = f" ({fault.place}{whose})" if fault.line is not None else ""
        print(f"{fault.t:8.2f} s  {fault.verdict}: {readable(fault.message, 400)}{where}", file=sys.stderr)
        if fault.hint:
            print(f"            {fault.hint}", file=sys.stderr)
    for each in recording.notes:
        note(f"note: {readable(each, 400)}")


def _told(recording: Recording) -> dict[str, Any]:
    """What a document says of a run."""
    faults = [
        {
            "t": fault.t,
            "verdict": fault.verdict,
            "who": fault.who,
            "place": storable(fault.place),
            "message": storable(fault.message),
            "hint": storable(fault.hint),
        }
        for fault in faults_of(recording)
    ]
    return {**trace(recording), "faults": faults}


def _drawn(recording: Recording, name: str, seed: int, own: Floor | None) -> bytes:
    driven_on = own if own is not None and own.name == recording.background else floor_of(recording)
    return png(draw_path(_as_trial(recording, seed), name, driven_on.pixels if driven_on else None))
