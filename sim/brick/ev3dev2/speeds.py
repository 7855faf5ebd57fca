"""Speeds in the units used in the course, with conversion to wheel degrees per second."""

from __future__ import annotations

import math
from typing import Any


class SpeedValue:
    """A speed in a unit; ``to_native_units`` returns wheel degrees per second."""

    def __init__(self, value: float, desc: str | None = None) -> None:
        self.value = value
        self.desc = desc

    def to_native_units(self, motor: Any) -> float:
        raise NotImplementedError

    def __mul__(self, other: float) -> SpeedValue:
        if not isinstance(other, int | float):
            raise TypeError(f"{self} can only be multiplied by an int or float")
        return type(self)(self.value * other)

    __rmul__ = __mul__

    def __lt__(self, other: SpeedValue) -> bool:
        return self.value < other.value

    def __eq__(self, other: object) -> bool:
        return isinstance(other, type(self)) and self.value == other.value

    def __hash__(self) -> int:
        return hash((type(self), self.value))

    def __str__(self) -> str:
        return f"{self.value}"


class SpeedPercent(SpeedValue):
    """Per cent of the maximum speed, -100..100."""

    def __init__(self, percent: float, desc: str | None = None) -> None:
        if not -100 <= percent <= 100:
            raise ValueError(f"{percent} is an invalid percentage, must be between -100 and 100 (inclusive)")
        super().__init__(percent, desc)

    def to_native_units(self, motor: Any) -> float:
        return self.value / 100 * motor.max_speed


class SpeedNativeUnits(SpeedValue):
    """Wheel degrees per second."""

    def to_native_units(self, motor: Any) -> float:
        if abs(self.value) > motor.max_speed:
            raise ValueError(f"{self.value} is an invalid speed, the most is {motor.max_speed}")
        return self.value


class _SpeedRate(SpeedValue):
    """A speed as a share of the maximum on the simulator's own scale."""

    _most = ""

    def to_native_units(self, motor: Any) -> float:
        maximum = getattr(motor, self._most)
        if abs(self.value) > maximum:
            raise ValueError(f"invalid {type(self).__name__}: {self.value}, the most is {maximum}")
        return float(self.value / maximum * motor.max_speed)


class SpeedRPS(_SpeedRate):
    """Rotations per second; the simulator's maximum is 2."""

    _most = "max_rps"


class SpeedRPM(_SpeedRate):
    """Rotations per minute; the simulator's maximum is 120."""

    _most = "max_rpm"


class SpeedDPS(_SpeedRate):
    """Degrees per second; the simulator's maximum is 720."""

    _most = "max_dps"


class SpeedDPM(_SpeedRate):
    """Degrees per minute; the simulator's maximum is 43200."""

    _most = "max_dpm"


Speed = float | SpeedValue


def round_to_whole(value: float) -> int:
    """Round to the nearest whole number, halves upwards, like the simulator's ``int(round(x))``."""
    return math.floor(value + 0.5)
