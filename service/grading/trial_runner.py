"""Resources that a worker keeps between trials: cameras over floors, arenas, and zygotes for student code.

A runner keeps no result, and no state that passes from one trial to the next.
"""

from __future__ import annotations

import logging
from collections import OrderedDict
from collections.abc import Callable, Iterable, Sequence
from contextlib import AbstractContextManager, nullcontext
from types import TracebackType
from typing import TypeVar

from responders.answered_trial import AnsweredRun, run_answered_trial
from responders.function_calls import CallResults, FunctionCall, call_functions
from responders.notebook_executor import ExecutedNotebook, RunPlanner, build_unstarted_recording, execute_notebook
from responders.notebook_process import NotebookSpec
from responders.outside_responder import OutsideAnswerer, RememberedAnswers
from responders.pair import run_pair
from responders.repeated_faults import FaultReplay
from responders.sandbox.child_exit import KilledFromOutside
from responders.sandbox.manager import Sandboxes
from responders.sandbox.meter import JobMeter
from responders.sandbox.private_folders import remove_stale_folders
from responders.sandbox.processor import one_processor
from responders.sandbox.served_child import LibrariesNeeded
from responders.training import Predictions, TrainingSpec, train_and_predict
from responders.trial import run_trial
from responders.trial_spec import ProgramSpec, ResponderSpec, TrialSpec
from service.grading.grader_locks import GraderLocks
from sim.arena import Arena
from sim.camera import CachedCamera, Cameras
from sim.errors import HostError
from sim.motion import Rectangle
from sim.recording import Fault, Recording
from sim.robot import Robot
from sim.shared_arena import SharedArena

_log = logging.getLogger(__name__)
_MAX_ARENAS = 4
Result = TypeVar("Result")
Key = TypeVar("Key")
AnArena = TypeVar("AnArena", bound=Arena)


class TrialRunner:
    """Runs trials. Use it as a context manager, or call ``close``. Everything starts on first use.

    All student code runs in ``sandboxes``, which are closed with the runner. ``slots`` are the locks shared by the
    machine's graders; None if there is only one grader. A ``meter`` counts the cost of one job. With ``spares``, child
    processes that would repeat a known fault are not run.
    """

    def __init__(
        self,
        sandboxes: Sandboxes | None = None,
        slots: GraderLocks | None = None,
        spares: bool = True,
    ) -> None:
        remove_stale_folders()
        self._slots = slots
        self._sandboxes = sandboxes or Sandboxes()
        self._spares = spares
        self._cameras = Cameras()
        self._arenas: OrderedDict[tuple[Rectangle, ...], Arena] = OrderedDict()
        self._shared_arenas: OrderedDict[tuple[tuple[Rectangle, ...], str, int], SharedArena] = OrderedDict()

    def run(
        self,
        spec: TrialSpec,
        obstacles: tuple[Rectangle, ...] = (),
        meter: JobMeter | None = None,
    ) -> Recording:
        """Run one trial.

        Raises:
            HostError: The machine failed.
            Exception: Whatever the meter's heartbeat raises.
        """
        meter = meter or JobMeter()
        partner = spec.partner
        if partner is not None:
            camera = self._cameras.open_camera(spec.floor.pixels)
            arenas = (
                self._reuse_shared_arena(obstacles, spec.robot, 1),
                self._reuse_shared_arena(obstacles, spec.robot, 2),
            )
            return self.run_with_retries(lambda: run_pair(spec, partner, arenas, camera, self._sandboxes, meter), meter)
        ground = self._prepare_arena_and_camera(spec, obstacles)
        return self.run_with_retries(lambda: run_trial(spec, *ground, self._sandboxes, meter), meter)

    def run_answered(
        self,
        spec: TrialSpec,
        obstacles: tuple[Rectangle, ...],
        ask: OutsideAnswerer,
        meter: JobMeter,
    ) -> AnsweredRun:
        """Run one trial with one robot, whose texts ``ask`` answers. Raises the same errors as ``run``.

        Also raises whatever ``ask`` raises, except ``Unanswered``.
        """
        ground, answers = self._prepare_arena_and_camera(spec, obstacles), RememberedAnswers(ask)
        return self.run_with_retries(lambda: run_answered_trial(spec, *ground, self._sandboxes, meter, answers), meter)

    def execute_notebook(
        self, spec: NotebookSpec, planner: RunPlanner, meter: JobMeter | None = None
    ) -> ExecutedNotebook:
        """Execute a notebook from top to bottom, with all its runs.

        ``planner`` serves one execution, so callers use ``run_with_retries`` themselves. Raises the same errors as
        ``run``.
        """
        return execute_notebook(spec, planner, self._prepare_arena_and_camera, self._sandboxes, meter or JobMeter())

    def build_unstarted_recording(
        self, spec: TrialSpec, obstacles: tuple[Rectangle, ...], fault: Fault, sandbox: str
    ) -> Recording:
        """Return the recording of a run that did not start because of ``fault``."""
        return build_unstarted_recording(spec, *self._prepare_arena_and_camera(spec, obstacles), fault, sandbox)

    def _prepare_arena_and_camera(
        self, spec: TrialSpec, obstacles: tuple[Rectangle, ...]
    ) -> tuple[Arena, CachedCamera]:
        return self._reuse_arena(obstacles), self._cameras.open_camera(spec.floor.pixels)

    def train(self, spec: TrainingSpec, meter: JobMeter | None = None) -> tuple[Predictions, ...]:
        """Train a submission's model and let it classify images. Raises the same errors as ``run``."""
        meter = meter or JobMeter()
        return self.run_with_retries(lambda: train_and_predict(spec, self._sandboxes, meter), meter)

    def call_functions(
        self, module: ResponderSpec, calls: Sequence[FunctionCall], seed: int, meter: JobMeter | None = None
    ) -> CallResults:
        """Call functions of a module in a fresh child, without a robot. Raises the same errors as ``run``."""
        meter = meter or JobMeter()
        return self.run_with_retries(
            lambda: call_functions(
                module.code,
                module.files,
                calls,
                module.limits,
                module.output_bytes,
                self._sandboxes,
                seed,
                meter,
                module.executed_statements,
            ),
            meter,
        )

    def skipping_repeats(self, repeats: FaultReplay) -> AbstractContextManager[None]:
        """Return a context in which children whose outcome ``repeats`` knows are not run."""
        return self._sandboxes.replacing_children(repeats.provide_child) if self._spares else nullcontext()

    def start_zygotes(self, processes: Iterable[ProgramSpec | ResponderSpec]) -> None:
        """Start the zygotes for these processes in parallel, without waiting."""
        for role, excluded_modules in dict.fromkeys((each.role, each.limits.excluded_modules) for each in processes):
            self._sandboxes.begin(role, excluded_modules)

    def check_sandbox(self) -> str:
        """Return the active sandbox layers.

        Raises:
            SandboxMissing: A required layer cannot be set up.
        """
        return self._sandboxes.check_isolation()

    def check_trial_isolation(self) -> None:
        """Check that trials leave nothing behind for later ones, as hidden trials require. Repeated occasionally.

        Raises:
            HostError: A trial could leave something behind.
        """
        reason = self._sandboxes.check_data_leaks() if self._sandboxes.isolation.seccomp else None
        if reason is not None:
            raise HostError(f"a trial could leave data for the next, so hidden scenarios are not graded here: {reason}")

    @property
    def children_cpu_seconds(self) -> float:
        """CPU seconds used by students' processes so far."""
        return self._sandboxes.children_cpu_seconds

    def close(self) -> None:
        """End all children, and release the sandboxes, cameras and arenas."""
        self._sandboxes.close()
        self._cameras.close()
        for arena in (*self._arenas.values(), *self._shared_arenas.values()):
            arena.close()
        self._arenas.clear()
        self._shared_arenas.clear()

    def __enter__(self) -> TrialRunner:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def run_with_retries(self, work: Callable[[], Result], meter: JobMeter) -> Result:
        """Do ``work``, and repeat it if it ends for a reason that is not the submission's fault.

        If a child imported an unexpected library, the repeated run provides the library from the start.
        """
        spent_before = meter.spent
        try:
            return self._run_unless_killed(work, meter)
        except LibrariesNeeded:
            meter.refund_since(spent_before)
            self._sandboxes.enable_libraries(meter)
        return self._run_unless_killed(work, meter)

    def _run_unless_killed(self, work: Callable[[], Result], meter: JobMeter) -> Result:
        """Do ``work``. If a child is killed from outside, repeat it exclusively, with no other grader running.

        Children of other graders may have used the memory. A child killed twice, the second time alone, is at fault
        itself.
        """
        spent_before = meter.spent
        try:
            with self._slots.shared_lock(meter.heartbeat) if self._slots is not None else nullcontext():
                return _run_on_one_processor(work)
        except KilledFromOutside as killed:
            _log.warning("the trial is run again, alone: %s", killed)
        meter.refund_since(spent_before)
        try:
            with self._exclusive_lock(meter):
                return _run_on_one_processor(work)
        except KilledFromOutside as killed:
            _log.warning("the trial is run a last time, alone: %s", killed)
        meter.refund_since(spent_before)
        with self._exclusive_lock(meter), self._sandboxes.blaming():
            return _run_on_one_processor(work)

    def _exclusive_lock(self, meter: JobMeter) -> AbstractContextManager[None]:
        return self._slots.exclusive_lock(meter.heartbeat) if self._slots is not None else nullcontext()

    def _reuse_arena(self, obstacles: tuple[Rectangle, ...]) -> Arena:
        return _reuse_or_create(self._arenas, obstacles, lambda: Arena(obstacles))

    def _reuse_shared_arena(self, obstacles: tuple[Rectangle, ...], robot: Robot, number: int) -> SharedArena:
        """Return the arena of robot ``number`` of a pair."""
        key, partner = (obstacles, robot.name, number), f"robot {3 - number}"
        return _reuse_or_create(self._shared_arenas, key, lambda: SharedArena(obstacles, robot, partner))


def _run_on_one_processor(work: Callable[[], Result]) -> Result:
    with one_processor():
        return work()


def _reuse_or_create(arenas: OrderedDict[Key, AnArena], key: Key, make: Callable[[], AnArena]) -> AnArena:
    """Return the arena of this key, created if needed. Closes the least recently used arena beyond the limit."""
    arena = arenas.pop(key, None) or make()
    arenas[key] = arena
    while len(arenas) > _MAX_ARENAS:
        arenas.popitem(last=False)[1].close()
    return arena
