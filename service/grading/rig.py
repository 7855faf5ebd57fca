"""What a worker keeps warm between trials: cameras over floors, arenas, and the zygotes of student code.

A rig holds no result and no state that one trial could leave for the next.
"""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Callable, Mapping, Sequence
from types import TracebackType

from responders.bridge import TrialOrder
from responders.conversation import Code
from responders.function_calls import Called, FunctionCall, call_functions
from responders.notebook_play import Played, Stage, never_ran, play_notebook
from responders.notebook_process import NotebookOrder
from responders.sandbox.manager import FULL, Sandboxes, Walls
from responders.sandbox.private_folders import remove_left_overs
from responders.sandbox.running_child import ChildLimits
from responders.training import Trained, TrainingOrder, train_and_name
from responders.trial import run_trial
from sim.arena import Arena
from sim.camera import CachedCamera, Cameras
from sim.errors import HostError
from sim.motion import Rectangle
from sim.recording import Fault, Recording

_MOST_ARENAS = 4


class Rig:
    """Runs trials. Use it as a context manager, or ``close`` it; everything is started when first needed."""

    def __init__(self, walls: Walls = FULL) -> None:
        remove_left_overs()
        self._sandboxes = Sandboxes(walls)
        self._forgets = walls.seccomp
        self._cameras = Cameras()
        self._arenas: OrderedDict[tuple[Rectangle, ...], Arena] = OrderedDict()

    def run(
        self,
        order: TrialOrder,
        obstacles: tuple[Rectangle, ...] = (),
        pulse: Callable[[], None] = lambda: None,
    ) -> Recording:
        """One trial. Raises HostError when the machine fails, and whatever ``pulse`` raises."""
        return run_trial(order, *self._ground(order, obstacles), self._sandboxes, pulse)

    def play(self, order: NotebookOrder, stage: Stage, pulse: Callable[[], None] = lambda: None) -> Played:
        """A notebook from top to bottom, with all its runs. Raises as ``run`` does."""
        return play_notebook(order, stage, self._ground, self._sandboxes, pulse)

    def never_ran(self, order: TrialOrder, obstacles: tuple[Rectangle, ...], fault: Fault, walls: str) -> Recording:
        """The recording of a run that did not come about because of ``fault``."""
        return never_ran(order, *self._ground(order, obstacles), fault, walls)

    def _ground(self, order: TrialOrder, obstacles: tuple[Rectangle, ...]) -> tuple[Arena, CachedCamera]:
        return self._arena(obstacles), self._cameras.camera(order.floor.picture)

    def train(self, order: TrainingOrder, pulse: Callable[[], None] = lambda: None) -> Trained:
        """A hand-in's model, trained and asked. Raises as ``run`` does."""
        return train_and_name(order, self._sandboxes, pulse)

    def call(
        self,
        code: Code,
        files: Mapping[str, bytes],
        calls: Sequence[FunctionCall],
        limits: ChildLimits,
        output_bytes: int,
        seed: int,
        pulse: Callable[[], None] = lambda: None,
    ) -> Called:
        """Functions of a module, called in a fresh child without a robot. Raises as ``run`` does."""
        return call_functions(code, files, calls, limits, output_bytes, self._sandboxes, seed, pulse)

    def check_walls(self) -> str:
        """Which walls stand round student code here. Raises WallsMissing when one cannot be put up."""
        return self._sandboxes.check()

    def check_forgetting(self) -> None:
        """Hidden trials must leave nothing for later ones. Raises HostError where they could; done once in a while."""
        reason = self._sandboxes.remembers() if self._forgets else None
        if reason is not None:
            raise HostError(f"a trial could leave something for the next, so nothing hidden is graded here: {reason}")

    @property
    def children_cpu_seconds(self) -> float:
        """CPU seconds that students' processes have used so far."""
        return self._sandboxes.children_cpu_seconds

    def close(self) -> None:
        self._sandboxes.close()
        self._cameras.close()
        while self._arenas:
            self._arenas.popitem()[1].close()

    def __enter__(self) -> Rig:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def _arena(self, obstacles: tuple[Rectangle, ...]) -> Arena:
        arena = self._arenas.pop(obstacles, None) or Arena(obstacles)
        self._arenas[obstacles] = arena
        while len(self._arenas) > _MOST_ARENAS:
            self._arenas.popitem(last=False)[1].close()
        return arena
