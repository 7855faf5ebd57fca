"""Trials of a notebook: it is executed from top to bottom, and the marked run becomes the recording.

The assignment decides which run is marked. ``notebook_runs.py`` plans the runs of the magics.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

from responders.notebook_executor import ExecutedNotebook, PlannedRun
from responders.notebook_process import NotebookSpec
from responders.sandbox.meter import JobMeter
from responders.trial_spec import TrialSpec
from service.grading.grade import TrialResult
from service.grading.notebook_runs import LoadedProgram, NotebookRuns, UnmarkedRuns, build_program_spec
from service.grading.trial_runner import TrialRunner
from sim.motion import Rectangle
from sim.recording import Fault, Recording, Verdict
from sim.sentences import Sentence, join_sentences
from submissions.magics import Flags
from submissions.marked_run import RunChoice, RunSite
from submissions.simulator_page import SimulatorSettings


@dataclass(frozen=True, slots=True)
class NotebookTrial:
    """The execution of the notebook in each trial, and the choice of the marked run.

    ``choice`` is None if the program comes from the assignment. With ``runs_spec_text``, the program text of the trial
    spec is run: the source rules were checked against it, and a notebook could supply another text. The seed and the
    agents in ``notebook`` are set for each trial.
    """

    notebook: NotebookSpec
    choice: RunChoice | None
    runs_spec_text: bool = False

    def run(self, spec: TrialSpec, obstacles: tuple[Rectangle, ...], runner: TrialRunner, meter: JobMeter) -> Recording:
        """Run the notebook and return the recording of the marked run, with the output of the whole notebook.

        If the marked run never started, another run is marked instead, if the choice allows it.

        Raises:
            HostError: The machine failed.
            Exception: Whatever the meter's heartbeat raises.
        """
        site = self.choice.site if self.choice is not None else None
        execution, started_sites = self._execute_notebook(spec, obstacles, site, runner, meter)
        replacement = self._choose_replacement(started_sites) if execution.marked_run is None else None
        if replacement is not None:
            assert site is not None
            # Plain text, because it is stored with the recording.
            note = f"the run of cell {site.cell} never started, so the run of cell {replacement.cell} is marked"
            execution, _ = self._execute_notebook(spec, obstacles, replacement, runner, meter)
            execution = replace(execution, notes=(note, *execution.notes))
            site = replacement
        if execution.marked_run is None:
            return execution.add_notebook_output(
                runner.build_unstarted_recording(
                    spec, obstacles, _explain_unstarted_run(execution, site), execution.sandbox
                )
            )
        recording = execution.marked_run.recording
        faults = recording.faults
        if execution.stopped is not None and not any(fault.who == "responder" for fault in faults):
            # The notebook was stopped in a cell, before or after this run.
            faults = (*faults, replace(execution.stopped, t=recording.end_t))
        verdict = faults[0].verdict if faults else Verdict.FINISHED
        return execution.add_notebook_output(replace(recording, faults=faults, verdict=verdict))

    def _choose_replacement(self, started_sites: Sequence[RunSite]) -> RunSite | None:
        """Return the run to mark if the marked run never started; None if there is no replacement."""
        if self.choice is None or self.choice.only or not started_sites:
            return None
        return next((site for site in self.choice.others if site in started_sites), started_sites[-1])

    def collect_shared_notes(self, results: Sequence[TrialResult]) -> tuple[str, ...]:
        """Return the notes on the cells once for all trials, since they are almost equal.

        Notes come from a visible trial: cells can put the robot's position into error messages.
        """
        return next((result.recording.notes for result in results if result.visibility == "visible"), ())

    def _execute_notebook(
        self,
        spec: TrialSpec,
        obstacles: tuple[Rectangle, ...],
        site: RunSite | None,
        runner: TrialRunner,
        meter: JobMeter,
    ) -> tuple[ExecutedNotebook, list[RunSite]]:
        """Execute the notebook with the run at ``site`` marked. Return the result and the sites of the runs."""
        planned_run = PlannedRun(spec, obstacles, None, True, True)

        def plan_marked_run(program: LoadedProgram, flags: Flags, setup: SimulatorSettings) -> PlannedRun:
            if self.runs_spec_text:
                program = replace(program, text=spec.program.code.text)
            run = replace(
                spec,
                program=build_program_spec(
                    program, spec.program.limits, spec.program.output_bytes, self.notebook.files
                ),
                pen_down="p" in flags.switches or "p" in program.flags.switches,
            )
            return replace(planned_run, spec=run)

        # Use the usual sheet, unless it is the marked one without its patches, which would reveal the answers.
        sheet = int(spec.floor.sheet == 0 and not spec.floor.label_patches)
        # Noise with the world's seed would identify the trial.
        limits, files = spec.program.limits, self.notebook.files
        output_bytes = spec.program.output_bytes
        unmarked_runs = UnmarkedRuns(limits, output_bytes, spec.seconds, spec.child_seed, files, spec.tick, sheet)
        notebook = replace(self.notebook, seed=spec.child_seed, agents=spec.agents)

        def execute() -> tuple[ExecutedNotebook, list[RunSite]]:
            planner = NotebookRuns(
                site, plan_marked_run, unmarked_runs, planned_run if self.choice is None else PlannedRun()
            )
            return runner.execute_notebook(notebook, planner, meter), planner.started

        return runner.run_with_retries(execute, meter)


def _explain_unstarted_run(execution: ExecutedNotebook, site: RunSite | None) -> Fault:
    """Return why the marked run never started: the notebook was stopped, its cell failed, or was never reached.

    It counts as a fault of the program, which did not run.
    """
    explanation = (
        Sentence("The robot program of cell %(cell)s is marked, but it never ran.", cell=site.cell)
        if site is not None
        else ""
    )
    cell_fault = next((fault for fault in execution.raised if site is not None and fault.cell == site.cell), None)
    cause = execution.stopped or cell_fault
    if cause is None:
        first_fault = execution.raised[0] if execution.raised else None
        hint = (
            Sentence("In %(place)s: %(fault)s", place=first_fault.place, fault=first_fault.message)
            if first_fault is not None
            else ""
        )
        cell = site.cell if site is not None else None
        message = join_sentences(explanation, Sentence("No cell of the notebook started it."))
        return Fault(0.0, Verdict.PROGRAM_ERROR, "program", message, cell=cell, hint=hint)
    verdict = Verdict.PROGRAM_ERROR if cause.verdict is Verdict.RESPONDER_ERROR else cause.verdict
    return replace(cause, who="program", verdict=verdict, hint=explanation)
