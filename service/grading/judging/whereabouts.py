"""Where each part of the robot was, from the start to the last tick, and when the pen drew.

Arrays have one row more than the recording has ticks: row 0 is the start, row i the state after tick i.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from sim.recording import Floats, Pose, Recording
from sim.robot import ROBOTS, Robot
from submissions.criteria.places import Part

#: Less than this between two ticks is standing still, mm and degrees.
STILL = 0.01


def times(recording: Recording) -> Floats:
    """Seconds, shape (n + 1,)."""
    return np.arange(len(recording.ticks) + 1) / 30.0


def headings(recording: Recording) -> Floats:
    """Degrees, unwrapped, shape (n + 1,)."""
    return np.concatenate([[recording.start.heading], recording.ticks.heading])


def positions(recording: Recording, part: Part = "robot") -> Floats:
    """x and y of a part, mm, shape (n + 1, 2). Where the pen is up, its rows are NaN.

    Positions that are no numbers are NaN too, so that no comparison with them holds.
    """
    ticks = recording.ticks
    middle = np.column_stack(
        [np.concatenate([[recording.start.x], ticks.x]), np.concatenate([[recording.start.y], ticks.y])]
    )
    if part == "robot":
        return middle
    if part == "pen":
        return np.where(pen_down(recording)[:, None], middle, np.nan)
    light = robot_of(recording).left_light if part == "left_light" else robot_of(recording).right_light
    # Local x is to the robot's right, y forward: turned by the heading less a right angle.
    turned = np.radians(headings(recording) - 90)
    cosine, sine = np.cos(turned), np.sin(turned)
    return middle + np.column_stack([cosine * light.x - sine * light.y, sine * light.x + cosine * light.y])


def pen_down(recording: Recording) -> NDArray[np.bool_]:
    """Whether the pen drew on the way to each row, shape (n + 1,); a row before a stroke begins belongs to it."""
    down = np.zeros(len(recording.ticks) + 1, dtype=bool)
    ends = [tick + 1 for tick, _ in recording.pen[1:]] + [len(down)]
    for (tick, is_down), end in zip(recording.pen, ends, strict=False):
        down[tick:end] |= is_down
    return down


def robot_of(recording: Recording) -> Robot:
    """The robot that was driven; the default one if its name is not known any more."""
    return ROBOTS.get(recording.robot, ROBOTS["Default_Robot"])


def place_at(recording: Recording, row: int) -> tuple[float, Pose]:
    """Time and pose of a row."""
    if row <= 0 or not len(recording.ticks):
        return 0.0, recording.start
    ticks = recording.ticks
    return row / 30.0, Pose(float(ticks.x[row - 1]), float(ticks.y[row - 1]), float(ticks.heading[row - 1]))


def travel(recording: Recording) -> tuple[Floats, Floats]:
    """What each tick added: mm along the heading before it (backwards less than 0), and degrees. Shapes (n,)."""
    points, degrees = positions(recording), headings(recording)
    along = np.radians(degrees[:-1])
    steps = np.diff(points, axis=0)
    return steps[:, 0] * np.cos(along) + steps[:, 1] * np.sin(along), np.diff(degrees)


def standing(recording: Recording) -> NDArray[np.bool_]:
    """Whether the robot stood still in each tick, shape (n,)."""
    ahead, turned = travel(recording)
    return (np.abs(ahead) < STILL) & (np.abs(turned) < STILL)


def stretches(mask: NDArray[np.bool_]) -> list[tuple[int, int]]:
    """The runs of true entries, as (first, one past the last)."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], mask, [False]]).astype(np.int8)))
    return list(zip(edges[::2].tolist(), edges[1::2].tolist(), strict=True))


def relative_to(start: Pose, x: float, y: float) -> tuple[float, float]:
    """How far ahead, and how far to the left, a point is of a pose, mm."""
    along = math.radians(start.heading)
    dx, dy = x - start.x, y - start.y
    return dx * math.cos(along) + dy * math.sin(along), -dx * math.sin(along) + dy * math.cos(along)
