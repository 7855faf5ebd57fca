"""Where the robot's parts are at a moment, what its light sensors look at, and whether that is in a zone.

Geometry only; what it is worth is decided in the modules of the kinds.
"""

from __future__ import annotations

import math
from typing import Literal

import numpy as np

from service.grading.judging.outcome import pose_at
from sim.camera import HEIGHT, WIDTH, sensor_mask
from sim.recording import Pose, Recording
from sim.robot import ROBOTS, LightSensor, robot
from sim.sensors import Footprint, footprint
from sim.trigonometry import sincos

Part = Literal["left", "right", "middle"]
Zone = tuple[float, float, float, float]


def part_at(recording: Recording, part: Part, pose: Pose) -> tuple[float, float]:
    """World mm of the middle of a light sensor, or of the axle, with the robot at ``pose``."""
    if part == "middle":
        return pose.x, pose.y
    sensor = _sensor(recording, part)
    turn = math.radians(pose.heading - 90)
    sine, cosine = math.sin(turn), math.cos(turn)
    return pose.x + cosine * sensor.x - sine * sensor.y, pose.y + sine * sensor.x + cosine * sensor.y


def part_at_time(recording: Recording, part: Part, t: float) -> tuple[float, float]:
    """As ``part_at``, after the last tick until ``t`` seconds."""
    return part_at(recording, part, pose_at(recording, t))


def footprint_at(recording: Recording, side: Literal["left", "right"], pose: Pose) -> Footprint:
    """The window that a light sensor sees; it does not turn with the robot, so it alone decides what is in it."""
    return footprint(_sensor(recording, side), pose.x, pose.y, *sincos(math.radians(pose.heading) - math.pi / 2))


def floor_share(recording: Recording, side: Literal["left", "right"], pose: Pose) -> float:
    """How much of what a light sensor sees is floor, 0 to 1; beside it all is black."""
    where, diameter = footprint_at(recording, side, pose), _sensor(recording, side).diameter
    rows, columns = where.row + np.arange(diameter), where.column + np.arange(diameter)
    floor = ((rows >= 0) & (rows < HEIGHT))[:, None] & ((columns >= 0) & (columns < WIDTH))
    mask = sensor_mask(diameter)
    return float((floor & mask).sum() / mask.sum())


def in_zone(place: tuple[float, float], zone: Zone, margin: float = 0.0) -> bool:
    """Whether a place is in [left, bottom, right, top], or at most ``margin`` mm outside each edge."""
    (x, y), (left, bottom, right, top) = place, zone
    return left - margin <= x <= right + margin and bottom - margin <= y <= top + margin


def _sensor(recording: Recording, side: Literal["left", "right"]) -> LightSensor:
    bolted = robot(recording.robot if recording.robot in ROBOTS else "Default_Robot")
    return bolted.left_light if side == "left" else bolted.right_light


def zone_words(zone: Zone) -> str:
    left, bottom, right, top = zone
    return f"x from {left:g} to {right:g} and y from {bottom:g} to {top:g}"
