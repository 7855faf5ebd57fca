"""``robomark run`` for a notebook: every robot that its cells start, one after the other. No marks."""

from __future__ import annotations

import sys
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path

from responders.channel import Channel
from responders.notebook_executor import ExecutedNotebook, PlannedRun
from responders.notebook_process import NotebookSpec
from responders.sandbox.meter import JobMeter
from responders.sandbox.running_child import ChildLimits
from responders.trial_spec import TrialSpec
from service.commands.shown import note, tell
from service.grading.notebook_runs import NotebookRuns, Program, UnmarkedRuns, program_spec
from service.grading.trial_runner import TrialRunner
from service.reports.plots.diagram_parts import Highlights
from service.reports.plots.drawn_diagrams import draw_diagram
from service.reports.plots.own_diagrams import title_of_cell
from service.reports.plots.style import png
from service.reports.readable import readable
from service.reports.written import write_file
from sim.floors import Floor, floor
from sim.recording import Recording
from sim.robot import robot
from sim.world import Noise
from submissions.diagram_cells import diagrams_in
from submissions.magics import Flags, Setup
from submissions.marked_cell import sites
from submissions.submission import Notebook


@dataclass(frozen=True, slots=True)
class RunLimits:
    """What the notebook's process and each robot program may use, and for how long robots run, in seconds."""

    notebook: ChildLimits
    program: ChildLimits
    output_bytes: int
    seconds: float


@dataclass(frozen=True, slots=True)
class LastRun:
    """How the command line wants the last robot program to be run."""

    flags: Flags
    seed: int
    sheet: int
    channel: Channel = field(default_factory=Channel)
    own_floor: Floor | None = None  # an image in the place of a floor


def run_notebook(
    notebook: Notebook,
    files: Mapping[str, bytes],
    limits: RunLimits,
    last: LastRun,
    runner: TrialRunner,
    meter: JobMeter | None = None,
) -> ExecutedNotebook:
    """Execute the notebook; its last robot program is run even without ``-R``, and with the flags of ``last``.

    Raises UsageError for a flag of the command line that cannot be read.
    """

    def marked_run(program: Program, flags: Flags, setup: Setup) -> PlannedRun:
        wanted = planner.simulator.apply(last.flags)
        spec = TrialSpec(
            program=program_spec(program, limits.program, limits.output_bytes, files),
            responder=None,
            collaborative=setup.collaborative or wanted.collaborative,
            floor=last.own_floor or floor(wanted.background, seed=last.sheet),
            robot=robot(wanted.robot),
            pose=wanted.pose,
            noise=Noise(wanted.light_noise, wanted.motor_noise),
            channel=last.channel,
            seconds=limits.seconds,
            seed=last.seed,
            child_seed=last.seed,
            pen_down=setup.pen_down or wanted.pen_down,
        )
        return PlannedRun(spec, wanted.obstacles, notes=(*setup.notes, *wanted.notes))

    found = sites(notebook)
    unmarked = UnmarkedRuns(limits.program, limits.output_bytes, limits.seconds, last.seed, files, sheet=last.sheet)
    planner = NotebookRuns(found[-1] if found else None, marked_run, unmarked, PlannedRun())
    cells = tuple(cell.source for cell in notebook.cells)
    spec = NotebookSpec(notebook.name, cells, files, limits.notebook, limits.output_bytes, last.seed)
    return runner.execute_notebook(spec, planner, meter)


def show_notebook(executed: ExecutedNotebook, show: Callable[[Recording], None]) -> None:
    """What the cells printed, every run by ``show``, and what was left out."""
    for line in executed.output.split("\n") if executed.output else ():
        tell(readable(line, 400))
    for run in executed.runs:
        tell(f"--- the robot, started by cell {run.cell} ---")
        show(run.recording)
    for each in executed.notes:
        note(f"note: {readable(each, 400)}")
    if executed.stopped is not None:
        stopped = executed.stopped
        print(f"{stopped.place}: {stopped.verdict}: {stopped.message}", file=sys.stderr)
    if not executed.runs:
        note("note: no robot was started: no cell begins with %%sim_magic_preloaded")


def show_diagrams(notebook: Notebook, folder: Path | None) -> None:
    """The diagrams of the notebook's cells as files, if there is a folder for them, and which cannot be drawn."""
    found = diagrams_in(notebook)
    for problem in found.problems:
        note(f"note: {readable(problem, 400)}")
    if folder is None:
        if found.cells:
            note("note: the notebook has diagrams; --diagrams FOLDER draws them")
        return
    for cell in found.cells:
        figure = draw_diagram(cell.diagram, title_of_cell(cell), notebook.name, Highlights())
        note(f"diagram: {write_file(folder, f'cell-{cell.cell}.png', png(figure))}")
