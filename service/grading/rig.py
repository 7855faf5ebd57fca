"""What a worker keeps warm between trials: cameras over floors, arenas, and the zygotes of student code.

A rig holds no result and no state that one trial could leave for the next.
"""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Callable
from types import TracebackType

from responders.bridge import TrialOrder
from responders.sandbox.manager import FULL, Sandboxes, Walls
from responders.trial import remove_left_overs, run_trial
from sim.arena import Arena, Rectangle
from sim.camera import Cameras
from sim.recording import Recording

_MOST_ARENAS = 8


class Rig:
    """Runs trials. Use it as a context manager, or ``close`` it; everything is started when first needed."""

    def __init__(self, walls: Walls = FULL) -> None:
        remove_left_overs()
        self._sandboxes = Sandboxes(walls)
        self._cameras = Cameras()
        self._arenas: OrderedDict[tuple[Rectangle, ...], Arena] = OrderedDict()

    def run(
        self,
        order: TrialOrder,
        obstacles: tuple[Rectangle, ...] = (),
        pulse: Callable[[], None] = lambda: None,
    ) -> Recording:
        """One trial. Raises HostError when the machine fails, and whatever ``pulse`` raises."""
        return run_trial(
            order, self._arena(obstacles), self._cameras.camera(order.floor.picture), self._sandboxes, pulse
        )

    def check_walls(self) -> str:
        """Which walls stand round student code here. Raises WallsMissing when one cannot be put up."""
        return self._sandboxes.check()

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
