"""Scenarios of an assignment: the conditions of its trials, and those that a scenario sweeps one at a time.

Imports no criteria, which refer to scenarios.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, fields
from types import MappingProxyType
from typing import Literal

from responders.channel import Channel
from sim.recording import Pose

Condition = Literal["offset_x", "offset_y", "heading", "light_noise", "motor_noise", "loss", "delay"]

#: A trial's level of the swept condition: at most one pair; empty without a sweep.
Coordinates = tuple[tuple[str, float], ...]


@dataclass(frozen=True, slots=True)
class VariedCondition:
    """A condition: its name, its unit and the range of valid levels."""

    words: str
    unit: str
    least: float
    most: float


CONDITIONS: Mapping[str, VariedCondition] = MappingProxyType(
    {
        "offset_x": VariedCondition("start offset in x", "mm", -100, 100),
        "offset_y": VariedCondition("start offset in y", "mm", -100, 100),
        "heading": VariedCondition("heading offset", "degrees", -180, 180),
        "light_noise": VariedCondition("light noise", "grey levels", 0, 128),
        "motor_noise": VariedCondition("motor noise", "degrees per second", 0, 500),
        "loss": VariedCondition("message loss", "share of messages", 0, 1),
        "delay": VariedCondition("message delay", "s", 0, 60),
    }
)


@dataclass(frozen=True, slots=True)
class Sweep:
    """The levels of each condition. Conditions without levels are not varied."""

    offset_x: tuple[float, ...] = ()
    offset_y: tuple[float, ...] = ()
    heading: tuple[float, ...] = ()
    light_noise: tuple[float, ...] = ()
    motor_noise: tuple[float, ...] = ()
    loss: tuple[float, ...] = ()
    delay: tuple[float, ...] = ()

    @property
    def conditions(self) -> tuple[str, ...]:
        """The conditions that are varied."""
        return tuple(field.name for field in fields(self) if getattr(self, field.name))

    @property
    def count(self) -> int:
        """The number of coordinates."""
        return sum(len(getattr(self, condition)) for condition in self.conditions) or 1

    def coordinates(self) -> Iterator[Coordinates]:
        """Yield each level of each condition in turn; a single empty coordinate if nothing is varied."""
        if not self.conditions:
            yield ()
        for condition in self.conditions:
            for level in getattr(self, condition):
                yield ((condition, level),)


NO_SWEEP = Sweep()


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
