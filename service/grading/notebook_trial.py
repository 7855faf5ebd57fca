"""One trial of a notebook: it is executed from top to bottom, and the marked run becomes the trial's recording.

What is marked is the assignment's to say; what the magics come to is ``notebook_runs.py``'s.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

from responders.notebook_executor import ExecutedNotebook, PlannedRun
from responders.notebook_process import NotebookSpec
from responders.sandbox.meter import JobMeter
from responders.trial_spec import TrialSpec
from service.grading.grade import TrialResult
from service.grading.notebook_runs import NotebookRuns, Program, UnmarkedRuns, program_spec
from service.grading.trial_runner import TrialRunner
from sim.motion import Rectangle
from sim.recording import Fault, Recording, Verdict
from submissions.magics import Flags, Setup
from submissions.marked_run import RunChoice, Site


@dataclass(frozen=True, slots=True)
class NotebookTrial:
    """How each trial executes the notebook, and which run in it is marked.

    ``choice`` is None when the program is the assignment's.
    With ``as_read`` the text of the trial's spec is what is run: its rules were held against that, and a notebook can
    hand over another. The seed and the agents in ``notebook`` are set for each trial.
    """

    notebook: NotebookSpec
    choice: RunChoice | None
    as_read: bool = False

    def run(self, spec: TrialSpec, obstacles: tuple[Rectangle, ...], runner: TrialRunner, meter: JobMeter) -> Recording:
        """The recording of the marked run, with what the whole notebook told.

        Where it was never come to, another that did run is marked instead, if the choice has others.
        Raises HostError when the machine fails, and whatever the meter's heartbeat raises.
        """
        site = self.choice.site if self.choice is not None else None
        executed, started = self._execute(spec, obstacles, site, runner, meter)
        instead = self._instead(started) if executed.marked is None else None
        if instead is not None:
            assert site is not None
            never = f"the run of cell {site.cell} was never come to, so that of cell {instead.cell} is marked"
            executed, _ = self._execute(spec, obstacles, instead, runner, meter)
            executed = replace(executed, notes=(never, *executed.notes))
            site = instead
        if executed.marked is None:
            return executed.told(runner.never_ran(spec, obstacles, _why_not(executed, site), executed.sandbox))
        recording = executed.marked.recording
        faults = recording.faults
        if executed.stopped is not None and not any(fault.who == "responder" for fault in faults):
            # It was stopped in a cell, before or after this run.
            faults = (*faults, replace(executed.stopped, t=recording.end_t))
        verdict = faults[0].verdict if faults else Verdict.FINISHED
        return executed.told(replace(recording, faults=faults, verdict=verdict))

    def _instead(self, started: Sequence[Site]) -> Site | None:
        """What is marked for a run that no cell came to; None where just that one is asked for."""
        if self.choice is None or self.choice.only or not started:
            return None
        return next((site for site in self.choice.others if site in started), started[-1])

    def notes_on_all(self, results: Sequence[TrialResult]) -> tuple[str, ...]:
        """What the cells could not do is much the same in every trial, and told once.

        Never that of a hidden trial: a cell can put into the words of an error where its robot stood.
        """
        return next((result.recording.notes for result in results if result.visibility == "visible"), ())

    def _execute(
        self,
        spec: TrialSpec,
        obstacles: tuple[Rectangle, ...],
        site: Site | None,
        runner: TrialRunner,
        meter: JobMeter,
    ) -> tuple[ExecutedNotebook, list[Site]]:
        """What came of the notebook with the run at ``site`` marked, and where robots were started."""
        planned = PlannedRun(spec, obstacles, None, True, True)

        def marked_run(program: Program, flags: Flags, setup: Setup) -> PlannedRun:
            if self.as_read:
                program = replace(program, text=spec.program.code.text)
            run = replace(
                spec,
                program=program_spec(program, spec.program.limits, spec.program.output_bytes, self.notebook.files),
                pen_down="p" in flags.switches or "p" in program.flags.switches,
            )
            return replace(planned, spec=run)

        # On the usual sheet, unless that is the marked one without its patches: they would tell the answers.
        sheet = int(spec.floor.sheet == 0 and not spec.floor.label_patches)
        # Their noise would tell the trial again, were it of the world's seed.
        limits, files = spec.program.limits, self.notebook.files
        output = spec.program.output_bytes
        unmarked = UnmarkedRuns(limits, output, spec.seconds, spec.child_seed, files, spec.tick, sheet)
        notebook = replace(self.notebook, seed=spec.child_seed, agents=spec.agents)

        def execute() -> tuple[ExecutedNotebook, list[Site]]:
            planner = NotebookRuns(site, marked_run, unmarked, planned if self.choice is None else PlannedRun())
            return runner.execute_notebook(notebook, planner, meter), planner.started

        return runner.undisturbed(execute, meter)


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
