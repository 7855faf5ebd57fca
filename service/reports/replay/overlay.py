"""Data of a trial drawn over the watched one in a replay, and the moment at which the two diverge.

The view decides which trials may be combined. The other trial's source and images are not included.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from service.grading.grade import TrialResult
from service.language import Language
from service.reports.display_text import to_one_line
from service.reports.replay.sources import Sources
from service.reports.replay.trial import trial_to_json
from service.reports.robots import iterate_robots
from sim.recording import SECOND, Recording

#: Larger differences of poses are visible.
_FAR_MM, _TURNED = 10.0, 5.0  # mm, degrees
_COLUMNS = frozenset({"x", "y", "heading", "left_position", "right_position"})
_KEPT_KEYS = ("verdict", "ended", "seconds", "tick", "messages", "events", "left_out")


def overlay_to_json(trial: TrialResult, other: TrialResult, name: str, language: Language) -> dict[str, Any]:
    """Return the data of ``other`` to show beside ``trial``. ``name`` is the name of its student."""
    told = trial_to_json(other, Sources(), language=language)
    robots = [{**robot, "columns": _select_columns(robot["columns"]), "images": []} for robot in told["robots"]]
    return {
        "name": to_one_line(name, 60),
        **{key: told[key] for key in _KEPT_KEYS},
        "robots": robots,
        "parted": find_divergence(trial.recording, other.recording),
    }


def find_divergence(one: Recording, other: Recording) -> float | None:
    """Return the first time at which a robot's poses differ by more than 10 mm or 5 degrees; None if they never do.

    A robot whose trial has ended stays where it is.
    """
    pairs = zip(iterate_robots(one), iterate_robots(other), strict=False)
    moments = [_find_robot_divergence(own, others) for (_, own), (_, others) in pairs]
    return min((moment for moment in moments if moment is not None), default=None)


def _find_robot_divergence(one: Recording, other: Recording) -> float | None:
    times = np.union1d(_compute_times(one), _compute_times(other))
    x, y, heading = (_interpolate_poses(one, times) - _interpolate_poses(other, times)).T
    turned = np.abs((heading + 180) % 360 - 180)
    apart = np.flatnonzero((np.hypot(x, y) > _FAR_MM) | (turned > _TURNED))
    return float(times[apart[0]]) if apart.size else None


def _compute_times(recording: Recording) -> NDArray[np.float64]:
    """Return the time of each pose in seconds, including the start."""
    return np.round(np.arange(len(recording.ticks) + 1) * recording.ticks.length / SECOND, 9)


def _interpolate_poses(recording: Recording, times: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the poses at these times, one row each, interpolated linearly between ticks."""
    ticks, start = recording.ticks, recording.start
    columns = ((ticks.x, start.x), (ticks.y, start.y), (ticks.heading, start.heading))
    known = [np.concatenate(([first], values)) for values, first in columns]
    return np.stack([np.interp(times, _compute_times(recording), values) for values in known], axis=1)


def _select_columns(columns: dict[str, Any]) -> dict[str, Any]:
    return {name: column for name, column in columns.items() if name in _COLUMNS}
