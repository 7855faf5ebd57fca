"""Executes a notebook from top to bottom. Each magic that starts a robot is a run with its own recording.

The caller's ``RunPlanner`` decides what each magic does: floor, pose, noise, and which run is marked.
"""

from __future__ import annotations

import contextlib
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from typing import Any, Protocol

from responders import wire
from responders.agents import AgentCounts, Agents, running_agents
from responders.bridge import Bridge
from responders.logger_file import read_log
from responders.notebook_process import NotebookProcess, NotebookSpec
from responders.sandbox.manager import Sandboxes
from responders.sandbox.meter import JobMeter
from responders.trial import MAX_NOTES, build_recording
from responders.trial_spec import TrialSpec
from responders.trial_world import build_robot_state, build_world
from sim.arena import Arena
from sim.camera import LightCamera
from sim.motion import Rectangle
from sim.recording import SECOND, Fault, Recording, Verdict
from sim.world import HashChain

_MAX_RUNS = 300
_MAX_LINE_LENGTH = 2000
_MAX_CELL_ERRORS = 5
#: Limit on the processor time of all unmarked runs together, as a multiple of the limit for one program.
_UNMARKED_CPU_FACTOR = 4
#: Limits on the simulated time of all unmarked runs together: seconds, and multiples of the trial's time limit. The
#: larger one applies.
_UNMARKED_SECONDS, _UNMARKED_RUNS = 600, 20
#: The worker's own processor time for a notebook's requests that is free. Drawing another floor takes hundredths of a
#: second.
_FREE_REQUEST_SECONDS = 5.0


@dataclass(frozen=True, slots=True)
class MagicCall:
    """A ``%sim_magic...`` call by a cell, with its place. All of it is untrusted."""

    cell: int
    line: int | None
    name: str
    arguments: str
    body: str | None  # the robot program of a ``%%sim_magic...`` cell


@dataclass(frozen=True, slots=True)
class PlannedRun:
    """The planner's decision on a magic: a run or None, and notes for the report."""

    spec: TrialSpec | None = None
    obstacles: tuple[Rectangle, ...] = ()
    program_cell: int | None = None  # the cell that holds the robot program
    marked: bool = False
    needs_responder: bool = False  # a missing responder is then a fault
    notes: tuple[str, ...] = ()


class RunPlanner(Protocol):
    """Decides what each magic does."""

    def plan_standstill(self) -> PlannedRun:
        """Return a plan with the state of the robot while it is not running."""

    def plan_call(self, call: MagicCall) -> PlannedRun:
        """Return the plan for a magic: a run, notes, or nothing."""

    def record_run(self, recording: Recording) -> None:
        """Record that a planned run has ended."""

    def plan_last_run(self) -> PlannedRun:
        """Return the run to make after all cells, if any."""


SceneFactory = Callable[[TrialSpec, tuple[Rectangle, ...]], tuple[Arena, LightCamera]]


@dataclass(frozen=True, slots=True)
class NotebookRun:
    """One run of a robot. ``cell`` is the cell that started it, or None after the last cell.

    ``printed`` is the number of characters of notebook output before the run.
    """

    cell: int | None
    marked: bool
    recording: Recording
    printed: int


@dataclass(frozen=True, slots=True)
class ExecutedNotebook:
    """The results of a notebook. ``raised`` holds the faults of single cells, ``stopped`` the fault that ended it."""

    runs: tuple[NotebookRun, ...]
    output: str
    log: str
    notes: tuple[str, ...]
    sandbox: str
    raised: tuple[Fault, ...]
    stopped: Fault | None

    @property
    def marked_run(self) -> NotebookRun | None:
        """Return the marked run, if there was one."""
        return next((run for run in self.runs if run.marked), None)

    def add_notebook_output(self, recording: Recording) -> Recording:
        """Return the recording of a run with the output, log and notes of the whole notebook."""
        return replace(
            recording,
            responder_output=self.output,
            responder_log=self.log,
            notes=(*recording.notes, *self.notes)[:MAX_NOTES],
            cell_errors=self.raised[:_MAX_CELL_ERRORS],
        )


def execute_notebook(
    spec: NotebookSpec, planner: RunPlanner, ground: SceneFactory, sandboxes: Sandboxes, meter: JobMeter
) -> ExecutedNotebook:
    """Execute the notebook in a fresh process and folder. ``meter`` counts the costs of the job.

    Raises:
        HostError: If the machine fails, not the student's code.
    """
    with sandboxes.open_private_folder() as folder, running_agents(spec.agents, spec.seed, sandboxes, meter) as agents:
        process = NotebookProcess(spec, sandboxes, folder, meter, agents)
        try:
            execution = _Execution(process, planner, ground, sandboxes, meter, agents)
            process.execute(execution.perform_request)
            execution.finish()
        finally:
            process.close()
        log, log_fault = read_log(folder, meter)
        runs = execution.runs
        if agents is not None:
            agents.finish()
            runs = [replace(run, recording=agents.add_outputs(run.recording)) for run in runs]
    return ExecutedNotebook(
        tuple(runs),
        "\n".join(process.output),
        log,
        (*process.notes, *(agents.notes if agents is not None else ())),
        process.sandbox,
        tuple(process.raised),
        process.stopped or log_fault,
    )


def build_unstarted_recording(
    spec: TrialSpec, arena: Arena, camera: LightCamera, fault: Fault, sandbox: str
) -> Recording:
    """Return the recording of a run that did not start: the robot stays at its start pose."""
    chain = HashChain()
    world = build_world(spec, arena, camera, chain)
    return Recording(
        background=spec.floor.name,
        start=spec.pose,
        end=spec.pose,
        end_t=0.0,
        ticks=world.ticks(),
        verdict=fault.verdict,
        sha256=chain.hexdigest(),
        faults=(fault,),
        obstacles=world.obstacles,
        label_patches=spec.floor.label_patches,
        sheet=spec.floor.sheet,
        robot=spec.robot.name,
        sandbox=sandbox,
    )


class _Execution:
    """The runs of one notebook execution."""

    def __init__(
        self,
        process: NotebookProcess,
        planner: RunPlanner,
        ground: SceneFactory,
        sandboxes: Sandboxes,
        meter: JobMeter,
        agents: Agents | None,
    ) -> None:
        self._process = process
        self._agents = agents
        self._planner = planner
        self._ground = ground
        self._sandboxes = sandboxes
        self._meter = meter
        self._unmarked_cpu = self._unmarked_seconds = 0.0
        self._marked_cpu = 0.0  # of the worker, for the marked run
        self._free_cpu = _FREE_REQUEST_SECONDS
        self._missing: str | None = None  # reason for the missing responder of a run that needs one
        self.runs: list[NotebookRun] = []

    def perform_request(self, frame: wire.Frame) -> dict[str, Any]:
        """Perform the request of a magic, or report the robot's state. Return the frame that resumes the notebook."""
        with self._charged():
            return self._run_request(frame)

    @contextlib.contextmanager
    def _charged(self) -> Iterator[None]:
        """Charge the worker's processor time to the job, except the free seconds and the marked run."""
        start = time.thread_time() - self._marked_cpu
        try:
            yield
        finally:
            spent = time.thread_time() - self._marked_cpu - start
            self._meter.charge_cpu(max(0.0, spent - self._free_cpu))
            self._free_cpu = max(0.0, self._free_cpu - spent)

    def _run_request(self, frame: wire.Frame) -> dict[str, Any]:
        if frame["do"] == "state":
            return {"do": "state", "state": self._build_state()}
        cell, line = self._process.locate_line(frame["line"])
        call = MagicCall(cell, line, frame["name"], frame["arguments"][:_MAX_LINE_LENGTH], frame["body"])
        planned_run = self._planner.plan_call(call)
        for note in planned_run.notes:
            self._process.add_note(frame["line"], note)
        if planned_run.spec is None:
            return _build_done_frame()
        refusal = self._describe_refusal(planned_run, planned_run.spec)
        if refusal:
            self._process.add_note(frame["line"], refusal)
            return _build_done_frame()
        bridge = self._run_robot(cell, planned_run, planned_run.spec)
        logged = bridge.collect_logged_data()
        return _build_done_frame(
            bridge.now, logged.data, logged.images, build_robot_state(bridge.world, planned_run.spec)
        )

    def _build_state(self) -> dict[str, Any]:
        standstill = self._planner.plan_standstill()
        assert standstill.spec is not None
        ground = self._ground(standstill.spec, standstill.obstacles)
        return build_robot_state(build_world(standstill.spec, *ground, HashChain()), standstill.spec)

    def finish(self) -> None:
        """Make the planner's final run. Add a hint to runs whose responder was defined too late."""
        cell_number, missing_message = self._process.answers_since, self._missing
        if cell_number is not None and missing_message is not None:
            self.runs = [_add_order_hint(run, missing_message, cell_number) if run.marked else run for run in self.runs]
        planned_run = self._planner.plan_last_run()
        if planned_run.spec is not None:
            self._run_robot(None, planned_run, planned_run.spec)

    def _describe_refusal(self, planned_run: PlannedRun, spec: TrialSpec) -> str:
        if planned_run.marked:
            return ""
        if len(self.runs) >= _MAX_RUNS:
            return f"the robot was not started: a notebook may start it {_MAX_RUNS} times"
        is_too_long = self._unmarked_seconds > max(_UNMARKED_SECONDS, _UNMARKED_RUNS * spec.seconds)
        if is_too_long or self._unmarked_cpu > _UNMARKED_CPU_FACTOR * spec.program.limits.cpu_seconds:
            return "the robot was not started: the runs before have used up the time for runs that are not marked"
        return ""

    def _run_robot(self, cell: int | None, planned_run: PlannedRun, spec: TrialSpec) -> Bridge:
        process = self._process
        output_length = len("\n".join(process.output))
        if planned_run.needs_responder:
            self._missing = process.missing
        is_answering = spec.collaborative and (process.missing is None or planned_run.needs_responder)
        first_call = len(process.calls)
        earlier_counts = self._agents.count_events() if self._agents is not None else AgentCounts()
        arena, camera = self._ground(spec, planned_run.obstacles)
        program = self._sandboxes.spawn(spec.program.role, spec.program.limits, meter=self._meter)
        start = time.thread_time()
        try:
            bridge = Bridge(spec, arena, camera, program, process if is_answering else None, self._meter)
            fault = bridge.run()
            if not planned_run.marked:
                self._unmarked_cpu += program.measure_cpu_seconds()
                self._unmarked_seconds += bridge.now / SECOND
        finally:
            program.close()
            if planned_run.marked:
                self._marked_cpu += time.thread_time() - start
        bridge.conversation.finish()
        if self._agents is not None:
            self._agents.seal(bridge.chain, bridge.now)
        faults = [*bridge.conversation.faults, *([fault] if fault else [])]
        if planned_run.needs_responder and process.missing is not None and not bridge.conversation.faults:
            faults.append(
                Fault(
                    0.0, Verdict.RESPONDER_ERROR, "responder", process.missing, hint=self._explain_missing_responder()
                )
            )
        faults = [self._locate_fault(each, planned_run.program_cell) for each in faults]
        # Loading faults of agents count in every run, other faults only in the run where they occur.
        faults += [] if self._agents is None else self._agents.collect_faults_since(earlier_counts)
        faults.sort(key=lambda each: each.t)
        recording = build_recording(spec, bridge, tuple(faults), program.sandbox)
        calls = [replace(call, before=call.before - earlier_counts.messages) for call in process.calls[first_call:]]
        recording = replace(recording, calls=tuple(calls))
        if self._agents is not None:
            recording = self._agents.add_messages_and_calls(recording, earlier_counts)
        self.runs.append(NotebookRun(cell, planned_run.marked, recording, output_length))
        self._planner.record_run(recording)
        return bridge

    def _locate_fault(self, fault: Fault, program_cell: int | None) -> Fault:
        if fault.who == "program" and fault.line is not None:
            return replace(fault, cell=program_cell)
        return self._process.locate_fault(fault)

    def _explain_missing_responder(self) -> str:
        """Return the message of the first failed cell, a possible reason for the missing responder, or ""."""
        if not self._process.raised:
            return ""
        first_error = self._process.raised[0]
        return f"In {first_error.place}: {first_error.message}"


def _add_order_hint(run: NotebookRun, missing_message: str, cell_number: int) -> NotebookRun:
    """Return the run with a hint to the cell that defines the responder, instead of ``missing_message``."""
    message = f"the responder is defined in cell {cell_number}, after the robot of cell {run.cell} has run"
    hint = f"Move cell {cell_number} above cell {run.cell}."
    faults = tuple(
        replace(fault, message=message, hint=hint)
        if fault.who == "responder" and missing_message in fault.message
        else fault
        for fault in run.recording.faults
    )
    return replace(run, recording=replace(run.recording, faults=faults))


def _build_done_frame(
    now: int = 0,
    data: tuple[tuple[str, float, float | None, float], ...] = (),
    images: tuple[str, ...] = (),
    state: dict[str, Any] | None = None,
) -> dict[str, Any]:
    return {"do": "done", "t": now, "seconds": now / SECOND, "data": data, "images": images, "state": state}
