"""The positions of images along a track, and the trials that have one. Draws nothing.

Answers were judged during grading.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

from service.grading.grade import Prediction, TrialResult
from service.grading.judging.geometry import locate_part
from service.reports.plots.sensor_images import is_right
from sim.recording import Recording

_MIN_TRACK_LENGTH = 60.0  # mm, the least extent of a track


@dataclass(frozen=True, slots=True)
class TrackImage:
    """One image: the left sensor's position (mm), the distance driven (mm), and the result."""

    x: float
    y: float
    distance: float
    heading: float  # degrees
    right: bool
    answered: bool


def find_tracks(predictions: Sequence[Prediction], trials: Sequence[TrialResult]) -> tuple[int, ...]:
    """Return the indices of the trials whose images were taken far enough apart to form a track."""
    track_indices = []
    for index in dict.fromkeys(prediction.trial for prediction in predictions):
        positions = [
            locate_part(trials[index].recording, "left", s.image.pose) for s in predictions if s.trial == index
        ]
        if len(positions) > 2 and max(math.dist(positions[0], place) for place in positions) >= _MIN_TRACK_LENGTH:
            track_indices.append(index)
    return tuple(track_indices)


def collect_track_images(
    predictions: Sequence[Prediction], trials: Sequence[TrialResult], index: int
) -> tuple[TrackImage, ...]:
    """Return the images of one trial, in the order sent."""
    recording = trials[index].recording
    distances = _compute_distances(recording)
    return tuple(
        TrackImage(
            *locate_part(recording, "left", prediction.image.pose),
            distances[min(max(prediction.image.tick, 0), len(distances) - 1)],
            prediction.image.pose.heading,
            is_right(prediction),
            prediction.answer is not None,
        )
        for prediction in predictions
        if prediction.trial == index
    )


def find_worst_track(predictions: Sequence[Prediction], trials: Sequence[TrialResult]) -> int:
    """Return the trial with a track and the smallest fraction of correct images, the first among equals."""

    def share_right(index: int) -> float:
        results = [is_right(prediction) for prediction in predictions if prediction.trial == index]
        return sum(results) / len(results)

    return min(find_tracks(predictions, trials), key=share_right)


def _compute_distances(recording: Recording) -> list[float]:
    """Return the distance driven by the centre of the axle at the start and after each tick, mm."""
    points = [(recording.start.x, recording.start.y), *zip(recording.ticks.x, recording.ticks.y, strict=True)]
    distances = [0.0]
    for previous_point, current_point in pairwise(points):
        step = math.dist(previous_point, current_point)
        distances.append(distances[-1] + (step if math.isfinite(step) else 0.0))
    return distances
