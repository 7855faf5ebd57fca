"""Sweeps: the conditions that a scenario varies one at a time, and their levels.

The classes are plain data; trials and judging are in ``service``.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, fields
from types import MappingProxyType
from typing import Literal

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
