"""How far from a point the robot ended, trial by trial, and how much that varies with the noise.

An observation: each trial is told by itself here and all together in ``spread_words``.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

from service.grading.grade import Measure, TrialResult
from service.grading.judging.outcome import Outcome, failed, passed
from submissions.criteria.path import Spread


def judge_spread(criterion: Spread, trial: TrialResult) -> Outcome:
    """Distance of the end from the point, mm."""
    recording = trial.recording
    distance = _distance(criterion, trial)
    measures = (Measure("distance from the target", distance, "mm"),)
    told = f"ended {distance:.0f} mm from ({criterion.x:g}, {criterion.y:g})"
    if criterion.within is not None and not distance <= criterion.within:
        return failed(
            f"Expected the robot to end within {criterion.within:g} mm of ({criterion.x:g}, {criterion.y:g}), "
            f"but it ended {distance:.0f} mm from it.",
            recording.end_t,
            recording.end,
            measures=measures,
        )
    return passed(f"The robot {told}.", recording.end_t, recording.end, measures)


def spread_words(criterion: Spread, trials: Sequence[TrialResult]) -> str:
    """Least, mean and greatest distance for each level of motor noise."""
    levels = sorted({trial.motor_noise for trial in trials})
    told = []
    for level in levels:
        distances = [_distance(criterion, trial) for trial in trials if trial.motor_noise == level]
        mean = sum(distances) / len(distances)
        told.append(
            f"with motor noise {level:g} {min(distances):.0f} to {max(distances):.0f} mm (mean {mean:.0f}, "
            f"{len(distances)} run{'' if len(distances) == 1 else 's'})"
        )
    return f"The robot ended at these distances from ({criterion.x:g}, {criterion.y:g}): {'; '.join(told)}."


def _distance(criterion: Spread, trial: TrialResult) -> float:
    end = trial.recording.end
    return math.hypot(end.x - criterion.x, end.y - criterion.y)
