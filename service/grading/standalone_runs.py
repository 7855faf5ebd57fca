"""Runs of a robot program or notebook without marks, set up by the flags of the magic.

The command ``run`` and the public Python API use it. Both show or store the recordings that it returns.
"""

from __future__ import annotations

import stat
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path

from models import load_weights
from responders.channel import Channel
from responders.notebook_executor import ExecutedNotebook, PlannedRun
from responders.notebook_process import NotebookSpec
from responders.sandbox.meter import JobLimits, JobMeter
from responders.sandbox.running_child import ChildLimits
from responders.source_file import SourceFile
from responders.trial_spec import PartnerSpec, ProgramSpec, ResponderSpec, TrialSpec
from service.grading.notebook_runs import LoadedProgram, NotebookRuns, UnmarkedRuns, build_program_spec
from service.grading.trial_runner import TrialRunner
from sim.errors import UsageError
from sim.floors import Floor, build_floor, build_floor_from_image, list_floor_names
from sim.recording import TICK, Recording
from sim.robot import get_robot
from sim.world import Noise
from submissions.assignment.limits import DEFAULT_LIMITS
from submissions.magics import Flags, split_program
from submissions.marked_run import find_runs
from submissions.notebook import LoadedNotebook, is_script, read_notebook, read_script
from submissions.simulator_page import SimulatorSettings, apply_flags
from submissions.source_text import decode_source, find_modules
from submissions.submission import Notebook

_IMAGES = (".png", ".jpg", ".jpeg")
_FILES_BYTES = 16 << 20
_RESPONDER = ChildLimits(DEFAULT_LIMITS.responder_cpu, DEFAULT_LIMITS.responder_memory_mb << 20)
_PROGRAM = ChildLimits(DEFAULT_LIMITS.program_cpu, DEFAULT_LIMITS.program_memory_mb << 20)
_NETWORKS = {"mlp_shapes_14x14.joblib": "shapes"}


@dataclass(frozen=True, slots=True)
class RunLimits:
    """Limits for the processes of a run: the responder or notebook, each robot program, and all together."""

    responder: ChildLimits = _RESPONDER
    program: ChildLimits = _PROGRAM
    output_bytes: int = DEFAULT_LIMITS.output_bytes
    programs_cpu_seconds: float = 150.0

    def create_meter(self) -> JobMeter:
        """Return a meter for all processes of one run."""
        return JobMeter(JobLimits(cpu_seconds=self.programs_cpu_seconds + self.responder.cpu_seconds))


@dataclass(frozen=True, slots=True)
class RunOptions:
    """Run options: the flags of the magic, and settings that have no flag.

    ``seconds`` is simulated time, ``tick`` is in units of simulated time. ``floor`` is an image that replaces the
    simulator's floor. Without ``sheet``, the seed selects the digit sheet.
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
        """The number of the digit sheet on the floor."""
        return self.seed if self.sheet is None else self.sheet


@dataclass(frozen=True, slots=True)
class ProgramFile:
    """A robot program: its file, the flags of its magic line, and its text."""

    path: Path
    flags: Flags
    text: str

    @property
    def code(self) -> SourceFile:
        """The program text under the file's name."""
        return SourceFile(self.path.name, self.text)


@dataclass(frozen=True, slots=True)
class ProgramRun:
    """The recording of a program run, its spec, and notes on its flags."""

    recording: Recording
    spec: TrialSpec
    notes: tuple[str, ...]
    over: Recording | None = None  # the recording of another program in the same world


def read_program(path: Path) -> ProgramFile:
    """Read the robot program in a file.

    Raises:
        UsageError: The file cannot be read, or its magic line is invalid.
    """
    return _parse_program(path, _read_source(path))


def read_runnable(path: Path) -> LoadedNotebook | ProgramFile:
    """Read a notebook, a notebook exported by nbconvert, or a robot program.

    Raises:
        UsageError: The file cannot be read or is invalid.
    """
    if path.suffix.lower() == ".ipynb":
        return read_notebook(read_file(path), path.name)
    text = _read_source(path)
    return LoadedNotebook(read_script(text, path.name)) if is_script(text) else _parse_program(path, text)


def load_responder(argument: str, limits: RunLimits) -> ResponderSpec:
    """Load the responder FILE or FILE:NAME with its neighbouring files. The course's networks are the default."""
    path, name = Path(argument), None
    if not path.exists() and ":" in argument:
        file, _, name = argument.rpartition(":")
        path = Path(file)
    text = _read_source(path)
    return ResponderSpec(
        SourceFile(path.name, text), read_neighbour_files(path, text), limits.responder, limits.output_bytes, name
    )


def load_floor(background: str | None) -> Floor | None:
    """Return the floor of an image file; None if ``background`` names a floor of the simulator."""
    path = Path(background or "")
    if background in list_floor_names() or path.suffix.lower() not in _IMAGES:
        return None
    return build_floor_from_image(path.name, read_file(path))


def run_program(
    program: ProgramFile,
    options: RunOptions,
    runner: TrialRunner,
    *,
    responder: ResponderSpec | None = None,
    second: ProgramFile | None = None,
    over: ProgramFile | None = None,
) -> ProgramRun:
    """Run a robot program, optionally with a second robot, and then ``over`` in the same world.

    The flags of the options override those of the program's magic line.

    Raises:
        UsageError: A flag has an invalid value, or the second program has no start position.
        HostError: The machine failed.
    """
    option_flags = options.flags
    flags = Flags(
        program.flags.preamble,
        program.flags.values | option_flags.values,
        program.flags.switches | option_flags.switches,
    )
    flags = flags if options.floor is None else flags.remove_value("b")
    settings = apply_flags(flags)
    spec = replace(
        _build_trial_spec(_build_program_spec(program, flags, options.limits), settings, options),
        responder=responder,
        collaborative=settings.collaborative or responder is not None or second is not None,
        partner=None if second is None else _build_partner_spec(second, options.limits),
    )
    meter = options.limits.create_meter()
    recording = runner.run(spec, settings.obstacles, meter)
    other_recording = None
    if over is not None:
        other_spec = replace(spec, program=_build_program_spec(over, over.flags, options.limits))
        other_recording = runner.run(other_spec, settings.obstacles, meter)
    return ProgramRun(recording, spec, tuple(settings.notes), other_recording)


def run_notebook(
    notebook: Notebook, files: Mapping[str, bytes], options: RunOptions, runner: TrialRunner
) -> ExecutedNotebook:
    """Execute a notebook. Its last robot program runs even without ``-R``, with the flags of the options.

    Raises:
        UsageError: A flag of the options has an invalid value.
        HostError: The machine failed.
    """
    limits = options.limits

    def plan_last_run(program: LoadedProgram, flags: Flags, notebook_settings: SimulatorSettings) -> PlannedRun:
        settings = planner.simulator.apply(options.flags)
        spec = replace(
            _build_trial_spec(
                build_program_spec(program, limits.program, limits.output_bytes, files), settings, options
            ),
            collaborative=notebook_settings.collaborative or settings.collaborative,
            pen_down=notebook_settings.pen_down or settings.pen_down,
        )
        return PlannedRun(spec, settings.obstacles, notes=(*notebook_settings.notes, *settings.notes))

    runs = find_runs(notebook)
    unmarked_runs = UnmarkedRuns(
        limits.program, limits.output_bytes, options.seconds, options.seed, files, options.tick, options.sheet_number
    )
    planner = NotebookRuns(runs[-1].site if runs else None, plan_last_run, unmarked_runs, PlannedRun())
    cells = tuple(cell.source for cell in notebook.cells)
    spec = NotebookSpec(notebook.name, cells, files, limits.responder, limits.output_bytes, options.seed)
    return runner.execute_notebook(spec, planner, limits.create_meter())


def read_neighbour_files(path: Path, text: str) -> dict[str, bytes]:
    """Return the files for a responder or notebook with this text: data, modules, and the course's networks."""
    files = {file: load_weights(model) for file, model in _NETWORKS.items()}
    files |= {f"{name}.py": module.encode() for name, module in _read_neighbour_modules(path, text).items()}
    remaining_bytes = _FILES_BYTES
    for neighbour in sorted(path.parent.iterdir()):
        if neighbour.suffix in (".py", ".ipynb", "") or neighbour.is_symlink() or not neighbour.is_file():
            continue
        remaining_bytes -= neighbour.stat().st_size
        if remaining_bytes >= 0:
            files[neighbour.name] = neighbour.read_bytes()
    return files


def read_file(path: Path) -> bytes:
    """Return the content of a regular file.

    Raises:
        UsageError: It cannot be read.
    """
    try:
        status = path.stat()
        if not stat.S_ISREG(status.st_mode):
            raise UsageError(f"{path} is not a file; expected one that can be read")
        if status.st_size > _FILES_BYTES:
            raise UsageError(f"{path} is too large; expected at most {_FILES_BYTES >> 20} MB")
        return path.read_bytes()
    except OSError as error:
        raise UsageError(f"{path} cannot be read: {error.strerror}") from error


def _build_trial_spec(program: ProgramSpec, settings: SimulatorSettings, options: RunOptions) -> TrialSpec:
    """Return the spec of a trial with one robot and no responder, in the world that the flags choose."""
    return TrialSpec(
        program=program,
        responder=None,
        collaborative=settings.collaborative,
        floor=options.floor or build_floor(settings.background, seed=options.sheet_number),
        robot=get_robot(settings.robot),
        pose=settings.pose,
        noise=Noise(settings.light_noise, settings.motor_noise),
        channel=options.channel,
        seconds=options.seconds,
        seed=options.seed,
        child_seed=options.seed,
        pen_down=settings.pen_down,
        tick=options.tick,
    )


def _build_program_spec(program: ProgramFile, flags: Flags, limits: RunLimits) -> ProgramSpec:
    modules = _read_neighbour_modules(program.path, program.text)
    return ProgramSpec(program.code, flags.preamble, limits.program, limits.output_bytes, modules)


def _build_partner_spec(second_program: ProgramFile, limits: RunLimits) -> PartnerSpec:
    """Return the second robot, as set up by its magic line."""
    if not {"x", "y"} <= second_program.flags.values.keys():
        name = second_program.path.name
        raise UsageError(f"{name}: does not say where the second robot starts; expected -x and -y in line 1")
    settings = apply_flags(second_program.flags)
    program = ProgramSpec(second_program.code, second_program.flags.preamble, limits.program, limits.output_bytes)
    return PartnerSpec(program, settings.pose, settings.pen_down)


def _read_neighbour_modules(path: Path, text: str) -> Mapping[str, str]:
    """Return the modules that the text imports from the file's folder."""

    def read_module(name: str) -> bytes | None:
        neighbour = path.parent / name
        if (
            neighbour.is_symlink()
            or not neighbour.is_file()
            or name == path.name
            or neighbour.stat().st_size > _FILES_BYTES
        ):
            return None
        return neighbour.read_bytes()

    return find_modules(text, read_module)


def _parse_program(path: Path, text: str) -> ProgramFile:
    try:
        return ProgramFile(path, *split_program(text))
    except UsageError as error:
        raise UsageError(f"{path.name}: {error}") from None


def _read_source(path: Path) -> str:
    return decode_source(read_file(path), path.name).text
