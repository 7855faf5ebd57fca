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
from service.reports.messages import iterate_robots
from service.reports.replay.sources import Sources
from service.reports.replay.trial import trial_to_json
from sim.recording import SECOND, Recording

#: Larger differences of poses are visible.
_FAR_MM, _TURNED = 10.0, 5.0  # mm, degrees
_COLUMNS = frozenset({"x", "y", "heading", "left_position", "right_position"})
_KEPT_KEYS = ("verdict", "ended", "seconds", "tick", "messages", "events", "left_out")


def overlay_to_json(trial: TrialResult, other_trial: TrialResult, name: str, language: Language) -> dict[str, Any]:
    """Return the data of ``other_trial`` to show beside ``trial``. ``name`` is the name of its student."""
    trial_data = trial_to_json(other_trial, Sources(), language=language)
    robots = [{**robot, "columns": _select_columns(robot["columns"]), "images": []} for robot in trial_data["robots"]]
    return {
        "name": to_one_line(name, 60),
        **{key: trial_data[key] for key in _KEPT_KEYS},
        "robots": robots,
        "parted": find_divergence(trial.recording, other_trial.recording),
    }


def find_divergence(recording: Recording, other_recording: Recording) -> float | None:
    """Return the first time at which a robot's poses differ by more than 10 mm or 5 degrees; None if they never do.

    A robot whose trial has ended stays where it is.
    """
    pairs = zip(iterate_robots(recording), iterate_robots(other_recording), strict=False)
    moments = [_find_robot_divergence(own, others) for (_, own), (_, others) in pairs]
    return min((moment for moment in moments if moment is not None), default=None)


def _find_robot_divergence(recording: Recording, other_recording: Recording) -> float | None:
    times = np.union1d(_compute_times(recording), _compute_times(other_recording))
    x, y, heading = (_interpolate_poses(recording, times) - _interpolate_poses(other_recording, times)).T
    heading_differences = np.abs((heading + 180) % 360 - 180)
    diverged_rows = np.flatnonzero((np.hypot(x, y) > _FAR_MM) | (heading_differences > _TURNED))
    return float(times[diverged_rows[0]]) if diverged_rows.size else None


def _compute_times(recording: Recording) -> NDArray[np.float64]:
    """Return the time of each pose in seconds, including the start."""
    return np.round(np.arange(len(recording.ticks) + 1) * recording.ticks.length / SECOND, 9)


def _interpolate_poses(recording: Recording, times: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the poses at these times, one row each, interpolated linearly between ticks."""
    ticks, start = recording.ticks, recording.start
    columns = ((ticks.x, start.x), (ticks.y, start.y), (ticks.heading, start.heading))
    series = [np.concatenate(([first], values)) for values, first in columns]
    return np.stack([np.interp(times, _compute_times(recording), values) for values in series], axis=1)


def _select_columns(columns: dict[str, Any]) -> dict[str, Any]:
    return {name: column for name, column in columns.items() if name in _COLUMNS}
