"""The robot program's interface to the simulator: the clock and the messages from the responder."""

from __future__ import annotations

from typing import Any

from brick_link import link, read_clock
from ev3dev2.motor import Motor
from ev3dev2.sensor.lego import ColorSensor, GyroSensor, UltrasonicSensor
from ev3dev2.sound import Sound

__all__ = [
    "ColorSensor",
    "GyroSensor",
    "Motor",
    "Sound",
    "UltrasonicSensor",
    "get_clock",
    "pyState",
    "robot_number",
    "showme",
]


def get_clock() -> float:
    """Return the seconds since the start of the program. The value changes thirty times a second during waits."""
    return read_clock()


def pyState() -> dict[str, list[Any]]:
    """Return ``{"messages": [...]}`` with the responder's ``JSON::`` answers, oldest first."""
    return link.state


def robot_number() -> int:
    """Return 1, or 2 on the second robot, so that one program can run on both."""
    return link.number


def showme() -> str:
    return "okay?"
