"""Planning of the runs that a notebook's magics start: runs with their own flags, and the marked run.

This module only decides. ``responders`` executes the cells and runs the robots.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

from responders.channel import Channel
from responders.notebook_executor import MagicCall, PlannedRun
from responders.sandbox.running_child import ChildLimits
from responders.source_file import SourceFile
from responders.trial_spec import ProgramSpec, TrialSpec
from sim.errors import UsageError
from sim.floors import build_floor
from sim.random_streams import RandomStream
from sim.recording import TICK, Recording
from sim.robot import get_robot
from sim.world import Noise
from submissions.magics import Flags, parse_flags
from submissions.marked_run import RunSite
from submissions.simulator_page import FRESH_PAGE, PageState, SimulatorPage, SimulatorSettings
from submissions.source_text import find_modules

#: The program that ``%sim_magic --refresh`` loads.
_REFRESH_PROGRAM = "print('Refreshing simulator...')"


@dataclass(frozen=True, slots=True)
class LoadedProgram:
    """The loaded robot program: its cell, its text with that cell's line numbers, and its flags."""

    cell: int
    text: str
    flags: Flags


_IDLE_PROGRAM = LoadedProgram(0, "", Flags())
#: Creates the marked run from the program, the flags of the magic that starts it, and the simulator settings.
MarkedRunPlanner = Callable[[LoadedProgram, Flags, SimulatorSettings], PlannedRun]


@dataclass(frozen=True, slots=True)
class NotebookPage:
    """The simulator between two magics: the state of its page, and the loaded robot program."""

    state: PageState = FRESH_PAGE
    program: LoadedProgram | None = None


NEW_NOTEBOOK_PAGE = NotebookPage()


@dataclass(frozen=True, slots=True)
class UnmarkedRuns:
    """Settings of unmarked runs, which keep their own flags. Each run draws its own chance from ``seed``."""

    limits: ChildLimits
    output_bytes: int
    seconds: float
    seed: int
    files: Mapping[str, bytes]  # source of importable modules
    tick: int = TICK
    sheet: int = 0


class NotebookRuns:
    """Follows the magics of one notebook execution, in call order."""

    def __init__(
        self,
        site: RunSite | None,
        marked_run: MarkedRunPlanner,
        unmarked_runs: UnmarkedRuns,
        last_run: PlannedRun,
        page: NotebookPage = NEW_NOTEBOOK_PAGE,
    ) -> None:
        """Create the planner.

        Args:
            site: Where the marked run starts, if any.
            marked_run: Plans the marked run.
            unmarked_runs: The settings of the other runs.
            last_run: The run after all cells, if any.
            page: The simulator before the first magic.
        """
        self._marked = site
        self._marked_run = marked_run
        self._unmarked = unmarked_runs
        self._last = last_run
        self.simulator = SimulatorPage(page.state)
        self._program = page.program
        self._count = 0
        self.marked_ran = False
        #: Sites of the runs, in order.
        self.started: list[RunSite] = []

    @property
    def page(self) -> NotebookPage:
        """The simulator after the magics so far."""
        return NotebookPage(self.simulator.state, self._program)

    def plan_standstill(self) -> PlannedRun:
        """The run of a robot that does not move, at its current pose."""
        setup = self.simulator.apply(Flags())
        return PlannedRun(self._build_unmarked_spec(_IDLE_PROGRAM, setup), setup.obstacles)

    def plan_call(self, call: MagicCall) -> PlannedRun:
        """Return the run that one magic starts."""
        site = RunSite(call.cell, call.line or 0)
        is_marked = site == self._marked and not self.marked_ran
        try:
            flags = parse_flags(call.name, call.arguments)
        except UsageError as error:
            if not (is_marked and call.body is not None):
                return PlannedRun(notes=(f"{error}; nothing was run",))
            return self._plan_run(
                site, is_marked, *self._load_program(call, Flags()), (f"the magic line is ignored: {error}",)
            )
        if call.body is None and call.name != "sim_magic":
            return PlannedRun(notes=(f"%{call.name} in a single line does nothing, as in the simulator",))
        if "F" in flags.switches:
            self._program = LoadedProgram(call.cell, _REFRESH_PROGRAM, Flags())
            return PlannedRun()
        if call.body is not None:
            self._load_program(call, flags)
        try:
            setup = self.simulator.apply(flags)
        except UsageError as error:
            if not is_marked:
                return PlannedRun(notes=(f"{error}; nothing was run",))
            return self._plan_run(
                site, is_marked, Flags(), self.simulator.apply(Flags()), (f"a flag is ignored: {error}",)
            )
        if not is_marked and "R" not in flags.switches:
            return PlannedRun(notes=setup.notes)
        return self._plan_run(site, is_marked, flags, setup, ())

    def record_run(self, recording: Recording) -> None:
        """Keep the robot at the end pose of the run."""
        self.simulator.set_pose(recording.end)

    def plan_last_run(self) -> PlannedRun:
        """Return the run after all cells, if any."""
        return self._last

    def _load_program(self, call: MagicCall, flags: Flags) -> tuple[Flags, SimulatorSettings]:
        text = "#\n" * (call.line or 0) + (call.body or "")
        self._program = LoadedProgram(call.cell, text, flags)
        return flags, self.simulator.apply(Flags())

    def _plan_run(
        self, site: RunSite, is_marked: bool, flags: Flags, setup: SimulatorSettings, notes: tuple[str, ...]
    ) -> PlannedRun:
        if self._program is None:
            return PlannedRun(notes=("no robot program has been loaded; nothing was run",))
        self.started.append(site)
        if is_marked:
            self.marked_ran = True
            planned_run = self._marked_run(self._program, flags, setup)
            return PlannedRun(
                planned_run.spec,
                planned_run.obstacles,
                self._program.cell,
                True,
                planned_run.needs_responder,
                notes + planned_run.notes,
            )
        self._count += 1
        return PlannedRun(
            self._build_unmarked_spec(self._program, setup),
            setup.obstacles,
            self._program.cell,
            notes=notes + setup.notes,
        )

    def _build_unmarked_spec(self, program: LoadedProgram, setup: SimulatorSettings) -> TrialSpec:
        """Return the spec of an unmarked run, by its own flags."""
        settings = self._unmarked
        seed = RandomStream(settings.seed, "notebook run").integer(self._count) >> 1
        return TrialSpec(
            program=build_program_spec(program, settings.limits, settings.output_bytes, settings.files),
            responder=None,
            collaborative=setup.collaborative,
            floor=build_floor(setup.background, seed=settings.sheet),
            robot=get_robot(setup.robot),
            pose=setup.pose,
            noise=Noise(setup.light_noise, setup.motor_noise),
            channel=Channel(),
            seconds=settings.seconds,
            seed=seed,
            child_seed=seed,
            pen_down=setup.pen_down,
            tick=settings.tick,
            records_lines=False,
        )


def build_program_spec(
    program: LoadedProgram, limits: ChildLimits, output_bytes: int, files: Mapping[str, bytes]
) -> ProgramSpec:
    """Return the bridge's spec of a cell's program, with the modules among ``files`` that it can import."""
    code = SourceFile(f"cell {program.cell}", program.text)
    return ProgramSpec(code, program.flags.preamble, limits, output_bytes, find_modules(code.text, files.get))
