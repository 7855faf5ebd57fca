"""One trial of a notebook: it is played from top to bottom, and the marked run becomes the trial's recording.

What is marked is the assignment's to say; what the magics come to is ``notebook_stage.py``'s.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

from responders.bridge import TrialOrder
from responders.notebook_play import Played, Staged
from responders.notebook_process import NotebookOrder
from responders.sandbox.meter import JobMeter
from responders.sandbox.running_child import ChildLimits
from service.grading.notebook_stage import NotebookStage, Program, UnmarkedRuns, program_order
from service.grading.rig import Rig
from sim.motion import Rectangle
from sim.recording import Fault, Recording, Verdict
from submissions.magics import Flags, Setup
from submissions.marked_cell import LAST, Site, marked_site
from submissions.submission import Notebook


@dataclass(frozen=True, slots=True)
class NotebookHandIn:
    """A notebook as a trial plays it, with the files in its folder and its limits."""

    notebook: Notebook
    files: Mapping[str, bytes]
    limits: ChildLimits
    output_bytes: int


@dataclass(frozen=True, slots=True)
class Marking:
    """The run that is marked: ``order`` has all but the program, unless the assignment brings that itself.

    ``which`` is the assignment's word for the cell; None when the program is the assignment's. With ``as_read`` the
    text in ``order`` is what is run: its rules were held against that, and a notebook can hand over another.
    """

    order: TrialOrder
    obstacles: tuple[Rectangle, ...]
    which: str | None
    as_read: bool = False


def run_notebook_trial(hand_in: NotebookHandIn, marking: Marking, rig: Rig, meter: JobMeter) -> Recording:
    """The recording of the marked run, with what the whole notebook told.

    Where the last robot program is marked and was never come to, the last that did run is marked instead.
    Raises HostError when the machine fails, and whatever the meter's pulse raises.
    """
    site = None if marking.which is None else marked_site(hand_in.notebook, marking.which)
    played, stage = rig.undisturbed(lambda: _play(hand_in, marking, site, rig, meter), meter)
    if played.marked is None and marking.which == LAST and stage.started:
        last = site = stage.started[-1]
        played, stage = rig.undisturbed(lambda: _play(hand_in, marking, last, rig, meter), meter)
    if played.marked is not None:
        recording = played.marked.recording
        faults = recording.faults
        if played.stopped is not None and not any(fault.who == "responder" for fault in faults):
            # It was stopped in a cell, before or after this run.
            faults = (*faults, replace(played.stopped, t=recording.end_t))
        verdict = faults[0].verdict if faults else Verdict.FINISHED
        return played.told(replace(recording, faults=faults, verdict=verdict))
    return played.told(rig.never_ran(marking.order, marking.obstacles, _why_not(played, site), played.walls))


def _play(
    hand_in: NotebookHandIn, marking: Marking, site: Site | None, rig: Rig, meter: JobMeter
) -> tuple[Played, NotebookStage]:
    order = marking.order
    staged = Staged(order, marking.obstacles, None, True, True)

    def marked_run(program: Program, flags: Flags, setup: Setup) -> Staged:
        if marking.as_read:
            program = replace(program, text=order.program.code.text)
        run = replace(
            order,
            program=program_order(program, order.program.limits, order.program.output_bytes),
            pen_down="p" in flags.switches or "p" in program.flags.switches,
        )
        return replace(staged, order=run)

    # On the usual sheet, unless that is the marked one without its patches: they would tell the answers.
    sheet = int(order.floor.sheet == 0 and not order.floor.patches)
    # Their noise would tell the trial again, were it of the world's seed.
    unmarked = UnmarkedRuns(order.program.limits, order.program.output_bytes, order.seconds, order.child_seed, sheet)
    stage = NotebookStage(site, marked_run, unmarked, staged if marking.which is None else Staged())
    notebook = hand_in.notebook
    played = rig.play(
        NotebookOrder(
            notebook.name,
            tuple(cell.source for cell in notebook.cells),
            hand_in.files,
            hand_in.limits,
            hand_in.output_bytes,
            order.child_seed,
        ),
        stage,
        meter,
    )
    return played, stage


def _why_not(played: Played, site: Site | None) -> Fault:
    """Why the marked run did not come about: the notebook was stopped, its cell failed, or never came to it.

    It counts as the program's fault, which then has not run.
    """
    never = f"The robot program of cell {site.cell} is marked, and was never run." if site is not None else ""
    failed = next((fault for fault in played.raised if site is not None and fault.cell == site.cell), None)
    cause = played.stopped or failed
    if cause is None:
        hint = f"In {played.raised[0].place}: {played.raised[0].message}" if played.raised else ""
        cell = site.cell if site is not None else None
        message = f"{never} Nothing in the notebook came to it."
        return Fault(0.0, Verdict.PROGRAM_ERROR, "program", message, cell=cell, hint=hint)
    verdict = Verdict.PROGRAM_ERROR if cause.verdict is Verdict.RESPONDER_ERROR else cause.verdict
    return replace(cause, who="program", verdict=verdict, hint=never)
