"""Planning of the runs that a notebook's magics start: runs with their own flags, and the marked run.

This module only decides. ``responders`` executes the cells and runs the robots.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

from responders.channel import Channel
from responders.code import Code
from responders.notebook_executor import MagicCall, PlannedRun
from responders.sandbox.running_child import ChildLimits
from responders.trial_spec import ProgramSpec, TrialSpec
from sim.chance import Stream
from sim.errors import UsageError
from sim.floors import floor
from sim.recording import TICK, Recording
from sim.robot import robot
from sim.world import Noise
from submissions.magics import Flags, Setup, Simulator, parse_flags
from submissions.marked_run import Site
from submissions.source_text import modules_of

#: The program that ``%sim_magic --refresh`` loads.
_REFRESHED = "print('Refreshing simulator...')"


@dataclass(frozen=True, slots=True)
class Program:
    """The loaded robot program: its cell, its text with that cell's line numbers, and its flags."""

    cell: int
    text: str
    flags: Flags


_NO_PROGRAM = Program(0, "", Flags())
#: Creates the marked run from the program, the flags of the magic that starts it, and the simulator settings.
MarkedRun = Callable[[Program, Flags, Setup], PlannedRun]


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

    def __init__(self, marked: Site | None, marked_run: MarkedRun, unmarked: UnmarkedRuns, last: PlannedRun) -> None:
        """Create the planner. ``marked`` is where the marked run starts, ``last`` the run after all cells, if any."""
        self._marked = marked
        self._marked_run = marked_run
        self._unmarked = unmarked
        self._last = last
        self.simulator = Simulator()
        self._program: Program | None = None
        self._count = 0
        self.marked_ran = False
        #: Sites of the runs, in order.
        self.started: list[Site] = []

    def standing(self) -> PlannedRun:
        """The run of a robot that does not move, at its current pose."""
        setup = self.simulator.apply(Flags())
        return PlannedRun(self._own(_NO_PROGRAM, setup), setup.obstacles)

    def call(self, call: MagicCall) -> PlannedRun:
        """Return the run that one magic starts."""
        here = Site(call.cell, call.line or 0)
        marked = here == self._marked and not self.marked_ran
        try:
            flags = parse_flags(call.name, call.arguments)
        except UsageError as error:
            if not (marked and call.body is not None):
                return PlannedRun(notes=(f"{error}; nothing was run",))
            return self._start(here, marked, *self._load(call, Flags()), (f"the magic line is ignored: {error}",))
        if call.body is None and call.name != "sim_magic":
            return PlannedRun(notes=(f"%{call.name} in a single line does nothing, as in the simulator",))
        if "F" in flags.switches:
            self._program = Program(call.cell, _REFRESHED, Flags())
            return PlannedRun()
        if call.body is not None:
            self._load(call, flags)
        try:
            setup = self.simulator.apply(flags)
        except UsageError as error:
            if not marked:
                return PlannedRun(notes=(f"{error}; nothing was run",))
            return self._start(here, marked, Flags(), self.simulator.apply(Flags()), (f"a flag is ignored: {error}",))
        if not marked and "R" not in flags.switches:
            return PlannedRun(notes=setup.notes)
        return self._start(here, marked, flags, setup, ())

    def ran(self, recording: Recording) -> None:
        """Keep the robot at the end pose of the run."""
        self.simulator.leave_at(recording.end)

    def last(self) -> PlannedRun:
        """Return the run after all cells, if any."""
        return self._last

    def _load(self, call: MagicCall, flags: Flags) -> tuple[Flags, Setup]:
        text = "#\n" * (call.line or 0) + (call.body or "")
        self._program = Program(call.cell, text, flags)
        return flags, self.simulator.apply(Flags())

    def _start(self, here: Site, marked: bool, flags: Flags, setup: Setup, notes: tuple[str, ...]) -> PlannedRun:
        if self._program is None:
            return PlannedRun(notes=("no robot program has been loaded; nothing was run",))
        self.started.append(here)
        if marked:
            self.marked_ran = True
            planned = self._marked_run(self._program, flags, setup)
            return PlannedRun(
                planned.spec,
                planned.obstacles,
                self._program.cell,
                True,
                planned.needs_responder,
                notes + planned.notes,
            )
        self._count += 1
        return PlannedRun(
            self._own(self._program, setup), setup.obstacles, self._program.cell, notes=notes + setup.notes
        )

    def _own(self, program: Program, setup: Setup) -> TrialSpec:
        """Return the spec of an unmarked run, by its own flags."""
        own = self._unmarked
        seed = Stream(own.seed, "notebook run").integer(self._count) >> 1
        return TrialSpec(
            program=program_spec(program, own.limits, own.output_bytes, own.files),
            responder=None,
            collaborative=setup.collaborative,
            floor=floor(setup.background, seed=own.sheet),
            robot=robot(setup.robot),
            pose=setup.pose,
            noise=Noise(setup.light_noise, setup.motor_noise),
            channel=Channel(),
            seconds=own.seconds,
            seed=seed,
            child_seed=seed,
            pen_down=setup.pen_down,
            tick=own.tick,
        )


def program_spec(program: Program, limits: ChildLimits, output_bytes: int, files: Mapping[str, bytes]) -> ProgramSpec:
    """Return the bridge's spec of a cell's program, with the modules among ``files`` that it can import."""
    code = Code(f"cell {program.cell}", program.text)
    return ProgramSpec(code, program.flags.preamble, limits, output_bytes, modules_of(code.text, files.get))
