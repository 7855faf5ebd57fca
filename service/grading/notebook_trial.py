"""One trial of a notebook: it is executed from top to bottom, and the marked run becomes the trial's recording.

What is marked is the assignment's to say; what the magics come to is ``notebook_runs.py``'s.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

from responders.notebook_executor import ExecutedNotebook, PlannedRun
from responders.notebook_process import NotebookSpec
from responders.sandbox.meter import JobMeter
from responders.sandbox.running_child import ChildLimits
from responders.trial_spec import TrialSpec
from service.grading.notebook_runs import NotebookRuns, Program, UnmarkedRuns, program_spec
from service.grading.trial_runner import TrialRunner
from sim.motion import Rectangle
from sim.recording import Fault, Recording, Verdict
from submissions.magics import Flags, Setup
from submissions.marked_cell import LAST, Site, marked_site
from submissions.submission import Notebook


@dataclass(frozen=True, slots=True)
class NotebookToRun:
    """A notebook as a trial executes it, with the files in its folder and its limits."""

    notebook: Notebook
    files: Mapping[str, bytes]
    limits: ChildLimits
    output_bytes: int


@dataclass(frozen=True, slots=True)
class Marking:
    """The run that is marked: ``spec`` has all but the program, unless the assignment brings that itself.

    ``which`` is the assignment's word for the cell; None when the program is the assignment's. With ``as_read`` the
    text in ``spec`` is what is run: its rules were held against that, and a notebook can hand over another.
    """

    spec: TrialSpec
    obstacles: tuple[Rectangle, ...]
    which: str | None
    as_read: bool = False


def run_notebook_trial(
    grading_request: NotebookToRun, marking: Marking, runner: TrialRunner, meter: JobMeter
) -> Recording:
    """The recording of the marked run, with what the whole notebook told.

    Where the last robot program is marked and was never come to, the last that did run is marked instead.
    Raises HostError when the machine fails, and whatever the meter's heartbeat raises.
    """
    site = None if marking.which is None else marked_site(grading_request.notebook, marking.which)
    executed, planner = runner.undisturbed(lambda: _execute(grading_request, marking, site, runner, meter), meter)
    if executed.marked is None and marking.which == LAST and planner.started:
        last = site = planner.started[-1]
        executed, planner = runner.undisturbed(lambda: _execute(grading_request, marking, last, runner, meter), meter)
    if executed.marked is not None:
        recording = executed.marked.recording
        faults = recording.faults
        if executed.stopped is not None and not any(fault.who == "responder" for fault in faults):
            # It was stopped in a cell, before or after this run.
            faults = (*faults, replace(executed.stopped, t=recording.end_t))
        verdict = faults[0].verdict if faults else Verdict.FINISHED
        return executed.told(replace(recording, faults=faults, verdict=verdict))
    return executed.told(runner.never_ran(marking.spec, marking.obstacles, _why_not(executed, site), executed.sandbox))


def _execute(
    grading_request: NotebookToRun, marking: Marking, site: Site | None, runner: TrialRunner, meter: JobMeter
) -> tuple[ExecutedNotebook, NotebookRuns]:
    spec = marking.spec
    planned = PlannedRun(spec, marking.obstacles, None, True, True)

    def marked_run(program: Program, flags: Flags, setup: Setup) -> PlannedRun:
        if marking.as_read:
            program = replace(program, text=spec.program.code.text)
        run = replace(
            spec,
            program=program_spec(program, spec.program.limits, spec.program.output_bytes),
            pen_down="p" in flags.switches or "p" in program.flags.switches,
        )
        return replace(planned, spec=run)

    # On the usual sheet, unless that is the marked one without its patches: they would tell the answers.
    sheet = int(spec.floor.sheet == 0 and not spec.floor.label_patches)
    # Their noise would tell the trial again, were it of the world's seed.
    unmarked = UnmarkedRuns(spec.program.limits, spec.program.output_bytes, spec.seconds, spec.child_seed, sheet)
    planner = NotebookRuns(site, marked_run, unmarked, planned if marking.which is None else PlannedRun())
    notebook = grading_request.notebook
    executed = runner.execute_notebook(
        NotebookSpec(
            notebook.name,
            tuple(cell.source for cell in notebook.cells),
            grading_request.files,
            grading_request.limits,
            grading_request.output_bytes,
            spec.child_seed,
        ),
        planner,
        meter,
    )
    return executed, planner


def _why_not(executed: ExecutedNotebook, site: Site | None) -> Fault:
    """Why the marked run did not come about: the notebook was stopped, its cell failed, or never came to it.

    It counts as the program's fault, which then has not run.
    """
    never = f"The robot program of cell {site.cell} is marked, and was never run." if site is not None else ""
    failed = next((fault for fault in executed.raised if site is not None and fault.cell == site.cell), None)
    cause = executed.stopped or failed
    if cause is None:
        hint = f"In {executed.raised[0].place}: {executed.raised[0].message}" if executed.raised else ""
        cell = site.cell if site is not None else None
        message = f"{never} Nothing in the notebook came to it."
        return Fault(0.0, Verdict.PROGRAM_ERROR, "program", message, cell=cell, hint=hint)
    verdict = Verdict.PROGRAM_ERROR if cause.verdict is Verdict.RESPONDER_ERROR else cause.verdict
    return replace(cause, who="program", verdict=verdict, hint=never)
