"""The door between the robot program and the simulator: the clock and the messages that came back from Python."""

from __future__ import annotations

from typing import Any

from brick_link import clock, link
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
    """Seconds since the program began; changes thirty times a second, while the program waits."""
    return clock()


def pyState() -> dict[str, list[Any]]:
    """``{"messages": [...]}``: what the responder answered with ``JSON::``, oldest first."""
    return link.state


def robot_number() -> int:
    """1, or 2 for the second robot: so that one program can be run on both."""
    return link.number


def showme() -> str:
    return "okay?"
