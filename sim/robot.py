"""RoboLab's robots: dimensions, sensor positions and wheel acceleration.

Local coordinates start at the middle of the axle, with x to the robot's right and y forward; lengths are in mm. A new
sensor begins as a column with ``sensor=`` in ``recording.py``; ``world.py`` measures it and ``brick/`` offers it.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from types import MappingProxyType

from sim.errors import UsageError

#: Acceleration in degrees per second squared of a wheel with weight 1.
ACCELERATION = 5000.0
MAX_SPEED = 1050.0  # wheel degrees per second at 100 %


@dataclass(frozen=True, slots=True)
class LightSensor:
    """Light sensor with a round window on the floor, ``diameter`` pixels wide."""

    x: float
    y: float
    diameter: int = 20


@dataclass(frozen=True, slots=True)
class Robot:
    """A robot's configuration. ``weight`` divides the acceleration; with 0, speeds change at once."""

    name: str = "Default_Robot"
    wheel_diameter: float = 56.0
    wheel_spacing: float = 180.0
    weight: float = 6.0
    left_light: LightSensor = LightSensor(-20, 30)
    right_light: LightSensor = LightSensor(20, 30)
    ultrasonic_y: float = 20.0
    front: float = 45.0
    back: float = -120.0
    half_width: float = 100.0

    @property
    def acceleration(self) -> float:
        """The maximum change of a wheel's speed per tick, in degrees per second."""
        return ACCELERATION / self.weight / 30 if self.weight else math.inf

    @property
    def reach(self) -> float:
        """The maximum distance of a point of the body from the middle of the axle, in mm."""
        return math.hypot(max(self.front, -self.back), self.half_width)


_DEFAULT = Robot()
_SMALL = Robot(
    name="Small_Robot",
    wheel_diameter=28,
    wheel_spacing=90,
    weight=0,
    left_light=LightSensor(-10, 15, 10),
    right_light=LightSensor(10, 15, 10),
    ultrasonic_y=10,
    front=22.5,
    back=-60,
    half_width=50,
)

#: Robots on the background Radial_grey: the light sensors are 60 mm to either side.
WIDENED: Mapping[str, str] = MappingProxyType(
    {
        "Default_Robot": "Default_Robot_Wide_Eyes",
        "Small_Robot": "Small_Robot_Widest_Eyes",
        "Small_Robot_Wide_Eyes": "Small_Robot_Widest_Eyes",
        "Sensor_Diameter_Config": "Sensor_Diameter_Config_Wide_Eyes",
    }
)
_COURSES: Mapping[str, Robot] = MappingProxyType(
    {
        "Default_Robot": _DEFAULT,
        "Small_Robot": _SMALL,
        "Small_Robot_Wide_Eyes": replace(
            _SMALL,
            name="Small_Robot_Wide_Eyes",
            left_light=LightSensor(-30, 15, 10),
            right_light=LightSensor(30, 15, 10),
        ),
        "Sensor_Diameter_Config": replace(
            _DEFAULT,
            name="Sensor_Diameter_Config",
            left_light=LightSensor(-20, 30, 30),
            right_light=LightSensor(20, 30, 10),
        ),
    }
)


def _widen_robot(robot: Robot) -> Robot:
    left, right = replace(robot.left_light, x=-60), replace(robot.right_light, x=60)
    return replace(robot, name=WIDENED[robot.name], left_light=left, right_light=right)


ROBOTS: Mapping[str, Robot] = MappingProxyType(
    {**_COURSES, **{wide.name: wide for wide in map(_widen_robot, _COURSES.values())}}
)


def get_robot(name: str) -> Robot:
    """Return the robot called ``name``.

    Raises:
        UsageError: RoboLab has no robot of this name.
    """
    try:
        return ROBOTS[name]
    except KeyError:
        raise UsageError(f"there is no robot called {name!r}; expected one of {', '.join(ROBOTS)}") from None


def get_default_robot_name(background: str) -> str:
    """Return the name of the default robot of a background (robolab section 1.1)."""
    return WIDENED["Default_Robot"] if background == "Radial_grey" else "Default_Robot"
