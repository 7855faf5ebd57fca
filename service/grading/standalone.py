"""Runs a robot program or a notebook by itself, set up by the flags of the magic: what happened, and no marks.

The command ``run`` and the public Python API call it; each shows or keeps the recordings that it returns.
"""

from __future__ import annotations

import stat
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path

from models import weights_bytes
from responders.channel import Channel
from responders.code import Code
from responders.notebook_executor import ExecutedNotebook, PlannedRun
from responders.notebook_process import NotebookSpec
from responders.sandbox.meter import JobLimits, JobMeter
from responders.sandbox.running_child import ChildLimits
from responders.trial_spec import PartnerSpec, ProgramSpec, ResponderSpec, TrialSpec
from service.grading.notebook_runs import NotebookRuns, Program, UnmarkedRuns, program_spec
from service.grading.trial_runner import TrialRunner
from sim.errors import UsageError
from sim.floors import Floor, floor, floor_from_image, names
from sim.recording import TICK, Recording
from sim.robot import robot
from sim.world import Noise
from submissions.magics import Flags, Setup, setup, split_program
from submissions.marked_run import runs_of
from submissions.notebook import ReadNotebook, is_script, read_notebook, read_script
from submissions.source_text import decode_source, modules_of
from submissions.submission import Notebook

_IMAGES = (".png", ".jpg", ".jpeg")
_FILES_BYTES = 16 << 20
_RESPONDER = ChildLimits(10.0, 512 << 20)
_PROGRAM = ChildLimits(5.0, 128 << 20)
_NETWORKS = {"mlp_shapes_14x14.joblib": "shapes"}


@dataclass(frozen=True, slots=True)
class RunLimits:
    """What the processes of a run may use: the responder or the notebook, each robot program, and all together."""

    responder: ChildLimits = _RESPONDER
    program: ChildLimits = _PROGRAM
    output_bytes: int = 1_000_000
    programs_cpu_seconds: float = 150.0

    def meter(self) -> JobMeter:
        """A meter of all processes of one run together."""
        return JobMeter(JobLimits(cpu_seconds=self.programs_cpu_seconds + self.responder.cpu_seconds))


@dataclass(frozen=True, slots=True)
class RunOptions:
    """How a program is run: by the flags of the magic, and by what they do not say.

    ``seconds`` is simulated time, ``tick`` is in units of simulated time; ``floor`` is an image in the place of one of
    the simulator's. The digit sheet is that of the seed unless ``sheet`` is given.
    """

    flags: Flags = field(default_factory=Flags)
    channel: Channel = field(default_factory=Channel)
    floor: Floor | None = None
    seconds: float = 60.0
    seed: int = 0
    sheet: int | None = None
    tick: int = TICK
    limits: RunLimits = field(default_factory=RunLimits)

    @property
    def sheet_number(self) -> int:
        """Which digit sheet lies on the floor."""
        return self.seed if self.sheet is None else self.sheet


@dataclass(frozen=True, slots=True)
class ProgramFile:
    """A robot program: the file that it is in, the flags of its magic line, and its text."""

    path: Path
    flags: Flags
    text: str

    @property
    def code(self) -> Code:
        """Its text under the file's name."""
        return Code(self.path.name, self.text)


@dataclass(frozen=True, slots=True)
class ProgramRun:
    """What happened in the run of a program, what it consisted of, and notes on its flags."""

    recording: Recording
    spec: TrialSpec
    notes: tuple[str, ...]
    over: Recording | None = None  # of another program in the same world


def read_program(path: Path) -> ProgramFile:
    """The robot program in a file. Raises UsageError where it cannot be read, or its magic line is wrong."""
    return _program_file(path, _source(path))


def read_runnable(path: Path) -> ReadNotebook | ProgramFile:
    """The notebook in a file, or that nbconvert has made a file of, else the robot program. Raises UsageError."""
    if path.suffix.lower() == ".ipynb":
        return read_notebook(read_file(path), path.name)
    text = _source(path)
    return ReadNotebook(read_script(text, path.name)) if is_script(text) else _program_file(path, text)


def find_responder(given: str, limits: RunLimits) -> ResponderSpec:
    """The responder FILE or FILE:NAME, with the files beside it, and the course's networks unless it brings its own."""
    path, name = Path(given), None
    if not path.exists() and ":" in given:
        file, _, name = given.rpartition(":")
        path = Path(file)
    text = _source(path)
    return ResponderSpec(
        Code(path.name, text), read_files_beside(path, text), limits.responder, limits.output_bytes, name
    )


def own_floor(background: str | None) -> Floor | None:
    """The floor that an image file is; None where a floor of the simulator is named."""
    path = Path(background or "")
    if background in names() or path.suffix.lower() not in _IMAGES:
        return None
    return floor_from_image(path.name, read_file(path))


def run_program(
    program: ProgramFile,
    options: RunOptions,
    runner: TrialRunner,
    *,
    responder: ResponderSpec | None = None,
    second: ProgramFile | None = None,
    over: ProgramFile | None = None,
) -> ProgramRun:
    """Run a robot program, with a second robot where there is one, and ``over`` once more in the same world.

    The options' flags count for more than those of the program's own magic line.

    Raises:
        UsageError: a flag has a wrong value, or the second program does not say where its robot starts.
        HostError: this machine fails.
    """
    wanted = options.flags
    flags = Flags(
        program.flags.preamble, program.flags.values | wanted.values, program.flags.switches | wanted.switches
    )
    flags = flags if options.floor is None else flags.without("b")
    chosen = setup(flags)
    spec = replace(
        _trial(_program_spec(program, flags, options.limits), chosen, options),
        responder=responder,
        collaborative=chosen.collaborative or responder is not None or second is not None,
        partner=None if second is None else _partner(second, options.limits),
    )
    meter = options.limits.meter()
    recording = runner.run(spec, chosen.obstacles, meter)
    beside = None
    if over is not None:
        other = replace(spec, program=_program_spec(over, over.flags, options.limits))
        beside = runner.run(other, chosen.obstacles, meter)
    return ProgramRun(recording, spec, tuple(chosen.notes), beside)


def run_notebook(
    notebook: Notebook, files: Mapping[str, bytes], options: RunOptions, runner: TrialRunner
) -> ExecutedNotebook:
    """Execute a notebook; its last robot program is run even without ``-R``, and with the options' flags.

    Raises:
        UsageError: a flag of the options has a wrong value.
        HostError: this machine fails.
    """
    limits = options.limits

    def last_run(program: Program, flags: Flags, own: Setup) -> PlannedRun:
        wanted = planner.simulator.apply(options.flags)
        spec = replace(
            _trial(program_spec(program, limits.program, limits.output_bytes, files), wanted, options),
            collaborative=own.collaborative or wanted.collaborative,
            pen_down=own.pen_down or wanted.pen_down,
        )
        return PlannedRun(spec, wanted.obstacles, notes=(*own.notes, *wanted.notes))

    runs = runs_of(notebook)
    unmarked = UnmarkedRuns(
        limits.program, limits.output_bytes, options.seconds, options.seed, files, options.tick, options.sheet_number
    )
    planner = NotebookRuns(runs[-1].site if runs else None, last_run, unmarked, PlannedRun())
    cells = tuple(cell.source for cell in notebook.cells)
    spec = NotebookSpec(notebook.name, cells, files, limits.responder, limits.output_bytes, options.seed)
    return runner.execute_notebook(spec, planner, limits.meter())


def read_files_beside(path: Path, text: str) -> dict[str, bytes]:
    """What a responder or a notebook with this text finds in its folder: data, modules, and the course's networks."""
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


def read_file(path: Path) -> bytes:
    """What is in a regular file. Raises UsageError where it cannot be read."""
    try:
        if not stat.S_ISREG(path.stat().st_mode):
            raise UsageError(f"{path} is not a file; expected one that can be read")
        return path.read_bytes()
    except OSError as error:
        raise UsageError(f"{path} cannot be read: {error.strerror}") from error


def _trial(program: ProgramSpec, chosen: Setup, options: RunOptions) -> TrialSpec:
    """A trial of one robot without a responder, in the world that the flags choose."""
    return TrialSpec(
        program=program,
        responder=None,
        collaborative=chosen.collaborative,
        floor=options.floor or floor(chosen.background, seed=options.sheet_number),
        robot=robot(chosen.robot),
        pose=chosen.pose,
        noise=Noise(chosen.light_noise, chosen.motor_noise),
        channel=options.channel,
        seconds=options.seconds,
        seed=options.seed,
        child_seed=options.seed,
        pen_down=chosen.pen_down,
        tick=options.tick,
    )


def _program_spec(program: ProgramFile, flags: Flags, limits: RunLimits) -> ProgramSpec:
    modules = _modules_beside(program.path, program.text)
    return ProgramSpec(program.code, flags.preamble, limits.program, limits.output_bytes, modules)


def _partner(second: ProgramFile, limits: RunLimits) -> PartnerSpec:
    """The second robot, as the first line of its program says."""
    if not {"x", "y"} <= second.flags.values.keys():
        name = second.path.name
        raise UsageError(f"{name}: does not say where the second robot starts; expected -x and -y in line 1")
    chosen = setup(second.flags)
    program = ProgramSpec(second.code, second.flags.preamble, limits.program, limits.output_bytes)
    return PartnerSpec(program, chosen.pose, chosen.pen_down)


def _modules_beside(path: Path, text: str) -> Mapping[str, str]:
    """What a file with this text imports from its folder."""

    def read(name: str) -> bytes | None:
        beside = path.parent / name
        if beside.is_symlink() or not beside.is_file() or name == path.name:
            return None
        return beside.read_bytes()

    return modules_of(text, read)


def _program_file(path: Path, text: str) -> ProgramFile:
    try:
        return ProgramFile(path, *split_program(text))
    except UsageError as error:
        raise UsageError(f"{path.name}: {error}") from None


def _source(path: Path) -> str:
    return decode_source(read_file(path), path.name).text
