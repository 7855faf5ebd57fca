"""Judging relative to a point of the floor: closest approach, rounds, and the distance of the end.

``path.py`` judges places to visit or to avoid.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from fractions import Fraction

import numpy as np

from service.grading.grade import CriterionResult, Measure, TrialResult
from service.grading.judging.geometry import (
    compute_headings,
    compute_positions,
    find_place,
    find_true_runs,
    measure_segment_distance,
)
from service.grading.judging.judge_declaration import (
    Case,
    IndexedTrials,
    declare_case_judge,
    declare_judge,
    judge_by_trial,
    summarise_trials,
)
from service.grading.judging.outcome import Outcome, fail_with, pass_with
from sim.recording import Floats, Recording
from submissions.criteria.point import Circuits, Closest, Spread

_RAY_LENGTH = 10_000.0
_TURN = 2.0


@declare_judge(Closest)
def judge_closest(criterion: Closest, trial: TrialResult) -> Outcome:
    """Judge the least distance of the robot's centre to a point, and its first turn relative to the point."""
    recording = trial.recording
    points = compute_positions(recording)
    nearest = _find_nearest(np.hypot(points[:, 0] - criterion.x, points[:, 1] - criterion.y))
    row, min_distance = nearest if nearest else (0, math.nan)
    straight_distance = _measure_straight_distance(recording, criterion.x, criterion.y)
    measures = (Measure("least distance", min_distance, "mm"), Measure("straight on", straight_distance, "mm"))
    point = f"({criterion.x:g}, {criterion.y:g})"
    moment = find_place(recording, row)
    if criterion.first_turn is not None:
        first_turn = _find_first_turn(recording, criterion.x, criterion.y)
        if first_turn is None or (first_turn[1] == "towards") != (criterion.first_turn == "towards"):
            behaviour = (
                "it did not turn at all" if first_turn is None else f"it turned {_describe_direction(first_turn[1])} it"
            )
            expectation = f"Expected the robot first to turn {_describe_direction(criterion.first_turn)}"
            return fail_with(
                f"{expectation} {point}, but {behaviour}.",
                *find_place(recording, first_turn[0] if first_turn else 0),
                measures=measures,
            )
    if criterion.distance is not None and not criterion.distance[0] <= min_distance <= criterion.distance[1]:
        low, high = criterion.distance
        return fail_with(
            f"Expected the robot's smallest distance to {point} to be {low:g} to {high:g} mm, but it was "
            f"{min_distance:.0f} mm.",
            *moment,
            measures=measures,
        )
    if criterion.than_straight is not None and (min_distance < straight_distance) != (
        criterion.than_straight == "nearer"
    ):
        requirement = "come nearer to" if criterion.than_straight == "nearer" else "stay farther from"
        return fail_with(
            f"Expected the robot to {requirement} {point} than by driving straight on ({straight_distance:.0f} mm), "
            f"but its smallest distance was {min_distance:.0f} mm.",
            *moment,
            measures=measures,
        )
    return pass_with(f"The robot's smallest distance to {point} was {min_distance:.0f} mm.", *moment, measures)


def _describe_direction(direction: str) -> str:
    return "towards" if direction == "towards" else "away from"


def _find_first_turn(recording: Recording, x: float, y: float) -> tuple[int, str] | None:
    """Return the row of the first turn by 2 degrees, and its direction relative to the point; None without a turn."""
    degrees = compute_headings(recording)
    rows = np.flatnonzero(np.abs(degrees - degrees[0]) > _TURN)
    if not len(rows):
        return None
    row = int(rows[0])
    start = recording.start
    bearing = math.degrees(math.atan2(y - start.y, x - start.x))
    is_left = (bearing - start.heading + 180) % 360 - 180 > 0
    return row, "towards" if (degrees[row] > degrees[0]) == is_left else "away"


def _measure_straight_distance(recording: Recording, x: float, y: float) -> float:
    """Return the least distance from a point to the ray ahead of the start, mm."""
    start = recording.start
    heading = math.radians(start.heading)
    end = (start.x + _RAY_LENGTH * math.cos(heading), start.y + _RAY_LENGTH * math.sin(heading))
    return float(measure_segment_distance(np.array([[x, y]]), (start.x, start.y), end)[0])


def _find_nearest(distances: Floats) -> tuple[int, float] | None:
    if np.isnan(distances).all():
        return None
    row = int(np.nanargmin(distances))
    return row, float(distances[row])


#: The gyro is smoothed over this many rows (1 s) before the search for corners.
_SMOOTH = 31
#: Driving straight for this many rows (0.5 s) separates two corners.
_LASTING = 15
#: An upper bound of this many rounds means no bound.
_NO_BOUND = 100
#: A smaller change of heading is not a corner, degrees.
_CORNER = 30.0


@declare_judge(Circuits)
def judge_circuits(criterion: Circuits, trial: TrialResult) -> Outcome:
    """Judge how many times, including fractions, and in which direction the path goes round a point."""
    recording = trial.recording
    rounds = compute_rounds(compute_positions(recording, criterion.of), criterion.x, criterion.y)
    times = float(abs(rounds[-1])) if len(rounds) else 0.0
    measures = [Measure("times round", times)]
    point, end = f"({criterion.x:g}, {criterion.y:g})", (recording.end_t, recording.end)
    low, high = criterion.times
    expected_times = f"{low:g} times" if low == high else f"{low:g} to {high:g} times"
    if high >= _NO_BOUND:
        expected_times = "at least once" if low == 1 else f"at least {low:g} times"
    if criterion.direction != "either" and times >= 0.5:
        direction = "anticlockwise" if rounds[-1] > 0 else "clockwise"
        if direction != criterion.direction:
            return fail_with(
                f"Expected the path to go {criterion.direction} round {point}, but it went {direction}.",
                *end,
                measures=tuple(measures),
            )
    if not low <= times <= high:
        pen_note = "" if len(rounds) else "; the pen was never down, which -p in the program's magic line does"
        score = Fraction(min(times / low, 1.0) if low else 0.0).limit_denominator(1000)
        return fail_with(
            f"Expected the path to go {expected_times} round {point}, but it went {times:.2f} times{pen_note}.",
            *end,
            score=score,
            measures=tuple(measures),
        )
    min_distance = float(
        np.nanmin(
            np.hypot(*(compute_positions(recording, criterion.of) - (criterion.x, criterion.y)).T), initial=np.inf
        )
    )
    if min_distance < criterion.clear_of:
        return fail_with(
            f"Expected the path to keep {criterion.clear_of:g} mm clear of {point}, but its smallest distance was "
            f"{min_distance:.0f} mm.",
            *end,
            measures=tuple(measures),
        )
    for number, (first_row, last_row) in enumerate(_find_complete_rounds(rounds), 1):
        headings = compute_headings(recording)[first_row : last_row + 1]
        change = float(abs(headings[-1] - headings[0]))
        corners = _count_corners(headings)
        measures += [Measure(f"gyro in round {number}", change, "°"), Measure(f"corners in round {number}", corners)]
        if criterion.gyro is not None and not criterion.gyro[0] <= change <= criterion.gyro[1]:
            return fail_with(
                f"Expected the gyro to change by {criterion.gyro[0]:g}° to {criterion.gyro[1]:g}° in each round, "
                f"but in round {number} it changed by {change:.0f}°.",
                *find_place(recording, last_row),
                measures=tuple(measures),
            )
        if criterion.corners is not None and corners != criterion.corners:
            return fail_with(
                f"Expected the gyro to change in {criterion.corners} steps in each round, "
                f"but in round {number} there were {corners}.",
                *find_place(recording, last_row),
                measures=tuple(measures),
            )
    return pass_with(f"The path went {times:.2f} times round {point}.", *end, tuple(measures))


def compute_rounds(points: Floats, x: float, y: float) -> Floats:
    """Return the rounds about (x, y) up to each row, anticlockwise positive.

    Rows with NaN (pen up) are left out.
    """
    drawn_points = points[~np.isnan(points[:, 0])]
    if not len(drawn_points):
        return np.zeros(0)
    angles = np.unwrap(np.arctan2(drawn_points[:, 1] - y, drawn_points[:, 0] - x))
    return np.asarray((angles - angles[0]) / (2 * np.pi))


def _find_complete_rounds(rounds: Floats) -> list[tuple[int, int]]:
    """Return the first and last row of each complete round."""
    max_rounds = np.maximum.accumulate(np.abs(rounds))
    ends = np.searchsorted(max_rounds, np.arange(1, int(max_rounds.max(initial=0.0)) + 1)).tolist()
    return list(zip([0, *ends], ends, strict=False))


def _count_corners(headings: Floats) -> int:
    """Return the number of corners: parts with above-average turning, at least 0.5 s apart and 30 degrees each."""
    if len(headings) <= _SMOOTH:
        return 0
    smoothed = np.convolve(headings, np.ones(_SMOOTH) / _SMOOTH, mode="valid")
    rate = np.diff(smoothed) * np.sign(headings[-1] - headings[0])
    is_fast = rate > rate.mean()
    for first, last in find_true_runs(~is_fast):
        if last - first < _LASTING and first > 0 and last < len(is_fast):
            is_fast[first:last] = True
    return sum(abs(float(smoothed[last] - smoothed[first])) >= _CORNER for first, last in find_true_runs(is_fast))


@declare_case_judge(Spread)
def judge_spread(criterion: Spread, case: Case) -> CriterionResult:
    """Judge the spread of the end positions. If no marks were lost, the message has all measurements."""

    def describe_trials(trials: IndexedTrials, outcomes: Sequence[Outcome]) -> str:
        if trials and all(outcome.passed for outcome in outcomes):
            return _describe_spread(criterion, [trial for _, trial in trials])
        return summarise_trials(trials, outcomes)

    return judge_by_trial(criterion, case, lambda _, trial: _judge_end(criterion, trial), describe_trials)


def _judge_end(criterion: Spread, trial: TrialResult) -> Outcome:
    """Judge the distance of the end from the point, mm."""
    recording = trial.recording
    distance = _measure_end_distance(criterion, trial)
    measures = (Measure("distance from the target", distance, "mm"),)
    description = f"ended {distance:.0f} mm from ({criterion.x:g}, {criterion.y:g})"
    if criterion.within is not None and not distance <= criterion.within:
        return fail_with(
            f"Expected the robot to end within {criterion.within:g} mm of ({criterion.x:g}, {criterion.y:g}), "
            f"but it ended {distance:.0f} mm from it.",
            recording.end_t,
            recording.end,
            measures=measures,
        )
    return pass_with(f"The robot {description}.", recording.end_t, recording.end, measures)


def _describe_spread(criterion: Spread, trials: Sequence[TrialResult]) -> str:
    """Return the least, mean and greatest distance for each level of motor noise."""
    levels = sorted({trial.motor_noise for trial in trials})
    descriptions = []
    for level in levels:
        distances = [_measure_end_distance(criterion, trial) for trial in trials if trial.motor_noise == level]
        mean = sum(distances) / len(distances)
        descriptions.append(
            f"with motor noise {level:g} {min(distances):.0f} to {max(distances):.0f} mm (mean {mean:.0f}, "
            f"{len(distances)} run{'' if len(distances) == 1 else 's'})"
        )
    return f"The robot ended at these distances from ({criterion.x:g}, {criterion.y:g}): {'; '.join(descriptions)}."


def _measure_end_distance(criterion: Spread, trial: TrialResult) -> float:
    end = trial.recording.end
    return math.hypot(end.x - criterion.x, end.y - criterion.y)
