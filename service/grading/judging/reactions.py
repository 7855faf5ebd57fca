"""Reactions of the robot after its light sensor has seen something dark."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from service.grading.judging.geometry import (
    compute_positions,
    compute_still_mask,
    compute_times,
    compute_travel,
    find_true_runs,
)
from sim.camera import HEIGHT, WIDTH
from sim.recording import Floats, Recording
from sim.recording_values import get_recorded_robot
from submissions.criteria.motion import Encounters

#: The smallest reversal (mm), turn (degrees) and stop (ticks) that count after an encounter.
_REVERSED, _TURNED, _STOPPED = 5.0, 15.0, 3


def find_falls(criterion: Encounters, recording: Recording) -> list[int]:
    """Return the rows at which a sensor's reading fell below the threshold. Readings off the floor don't count."""
    ticks = recording.ticks
    readings = {"left": ticks.left_rgb, "right": ticks.right_rgb}
    is_dark: NDArray[np.bool_] = np.zeros(len(ticks), dtype=bool)
    for side, rgb in readings.items():
        if criterion.light in (side, "either"):
            x, y = compute_positions(recording, "left_light" if side == "left" else "right_light")[1:].T
            radius = get_recorded_robot(recording).left_light.diameter / 2
            is_on_floor = (x >= radius) & (x <= WIDTH - radius) & (y >= radius) & (y <= HEIGHT - radius)
            is_dark |= is_on_floor & (rgb[:, 0] / 255 * 100 < criterion.below)
    return [first + 1 for first, _ in find_true_runs(is_dark)]


def find_answered_falls(criterion: Encounters, recording: Recording, falls: list[int]) -> list[int]:
    """Return the falls after which everything required happened in order and in time."""
    forward_steps, turns = compute_travel(recording)
    motion = _Motion(-np.minimum(forward_steps, 0), turns, compute_still_mask(recording))
    t = compute_times(recording)
    ends = np.searchsorted(t, t[falls] + criterion.seconds, side="right") - 1
    return [
        row
        for row, end in zip(falls, ends.tolist(), strict=True)
        if _has_all_reactions(criterion.then, motion, row, end)
    ]


@dataclass(frozen=True, slots=True)
class _Motion:
    """The motion in each tick, shape (n,): mm backwards, degrees, and whether the robot stood still."""

    backwards: Floats
    turned: Floats
    still: NDArray[np.bool_]


def _has_all_reactions(reactions: tuple[str, ...], motion: _Motion, start: int, end: int) -> bool:
    for reaction in reactions:
        window = slice(start, end)
        if reaction == "reverse":
            is_reached = np.cumsum(motion.backwards[window]) >= _REVERSED
        elif reaction == "turn":
            is_reached = np.abs(np.cumsum(motion.turned[window])) >= _TURNED
        else:
            still_counts = np.cumsum(motion.still[window])
            is_reached = (
                still_counts - np.concatenate([np.zeros(_STOPPED, dtype=int), still_counts])[: len(still_counts)]
                >= _STOPPED
            )
        if not is_reached.any():
            return False
        start += int(np.argmax(is_reached)) + 1
    return True
