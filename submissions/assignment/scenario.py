"""Scenarios of an assignment: the conditions of its trials. Imports no criteria, which refer to scenarios."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from responders.channel import Channel
from sim.recording import Pose
from submissions.sweep import NO_SWEEP, Sweep

_DEFAULT_CHANNEL = Channel()

Visibility = Literal["visible", "hidden", "after_due_date", "after_published"]


@dataclass(frozen=True, slots=True)
class Draw:
    """The numbers of trials that are drawn from a pool: at least, and at most before the whole pool is run."""

    least: int = 4
    most: int = 40


@dataclass(frozen=True, slots=True)
class Scenario:
    """Conditions of trials: poses x swept levels x noise levels x seeds.

    A second robot starts from the second pose with the same number. ``choose = "random"`` draws one pose per trial,
    from the trial's seed. ``"shuffled"`` uses each pose once, in an order from the scenario's seed. ``start_jitter`` is
    the maximum random change of each start pose in x and y (mm) and heading (degrees), drawn from the trial's seed.

    With ``draw``, the trials are a pool: criteria are defined over all of them, and a grading may run only the first.
    """

    id: str
    poses: tuple[Pose, ...]
    title: str = ""
    choose: Literal["each", "random", "shuffled"] = "each"
    trials: int = 1
    seconds: float = 60.0
    light_noise: tuple[float, ...] = (0.0,)
    motor_noise: tuple[float, ...] = (0.0,)
    channel: Channel = _DEFAULT_CHANNEL
    visibility: Visibility = "visible"
    start_jitter: tuple[float, float, float] = (0.0, 0.0, 0.0)
    sweep: Sweep = NO_SWEEP
    second_poses: tuple[Pose, ...] = ()  # one per pose, or none
    draw: Draw | None = None

    @property
    def trial_count(self) -> int:
        """The product of poses, swept levels, noise levels and repetitions."""
        poses = 1 if self.choose == "random" else len(self.poses)
        return poses * self.sweep.count * len(self.light_noise) * len(self.motor_noise) * self.trials

    def varies(self, condition: str) -> bool:
        """Return whether the trials differ in this condition, through a sweep or a list of noise levels."""
        noises = {"light_noise": self.light_noise, "motor_noise": self.motor_noise}
        return len(getattr(self.sweep, condition) or noises.get(condition, ())) > 1
