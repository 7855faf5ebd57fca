"""What the magics of a notebook come to: runs with their own flags, and the one run that is marked.

It decides only; the cells are executed and the robots run by ``responders``.
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

#: What ``%sim_magic --refresh`` puts in the place of the program.
_REFRESHED = "print('Refreshing simulator...')"


@dataclass(frozen=True, slots=True)
class Program:
    """The robot program that is loaded: the cell it is in, its text with that cell's line numbers, its flags."""

    cell: int
    text: str
    flags: Flags


_NO_PROGRAM = Program(0, "", Flags())
#: From the program, the flags of the magic that starts it and the simulator's set-up to the marked run.
MarkedRun = Callable[[Program, Flags, Setup], PlannedRun]


@dataclass(frozen=True, slots=True)
class UnmarkedRuns:
    """What runs have that keep their own flags; each draws its own chance from ``seed``."""

    limits: ChildLimits
    output_bytes: int
    seconds: float
    seed: int
    files: Mapping[str, bytes]  # of which programs import modules
    tick: int = TICK
    sheet: int = 0


class NotebookRuns:
    """Follows the magics of one execution, in the order in which they are called."""

    def __init__(self, marked: Site | None, marked_run: MarkedRun, unmarked: UnmarkedRuns, last: PlannedRun) -> None:
        """``marked`` is where the marked run starts; ``last`` what is run after all cells, if anything."""
        self._marked = marked
        self._marked_run = marked_run
        self._unmarked = unmarked
        self._last = last
        self.simulator = Simulator()
        self._program: Program | None = None
        self._count = 0
        self.marked_ran = False
        #: Where robots were started, in order.
        self.started: list[Site] = []

    def standing(self) -> PlannedRun:
        """How the robot stands that does not run."""
        setup = self.simulator.apply(Flags())
        return PlannedRun(self._own(_NO_PROGRAM, setup), setup.obstacles)

    def call(self, call: MagicCall) -> PlannedRun:
        """What one magic comes to."""
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
        """The robot stays where it has come to."""
        self.simulator.leave_at(recording.end)

    def last(self) -> PlannedRun:
        """What is run after all cells, if anything."""
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
        """A run as its own flags have it."""
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
    """The program of a cell as the bridge takes it, with the modules among ``files`` that it can import."""
    code = Code(f"cell {program.cell}", program.text)
    return ProgramSpec(code, program.flags.preamble, limits, output_bytes, modules_of(code.text, files.get))
