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

_FAR = 10_000.0
_TURN = 2.0


@declare_judge(Closest)
def judge_closest(criterion: Closest, trial: TrialResult) -> Outcome:
    """Judge the least distance of the robot's centre to a point, and its first turn relative to the point."""
    recording = trial.recording
    points = compute_positions(recording)
    near = _find_nearest(np.hypot(points[:, 0] - criterion.x, points[:, 1] - criterion.y))
    row, least = near if near else (0, math.nan)
    straight = _measure_straight_distance(recording, criterion.x, criterion.y)
    measures = (Measure("least distance", least, "mm"), Measure("straight on", straight, "mm"))
    point = f"({criterion.x:g}, {criterion.y:g})"
    where = find_place(recording, row)
    if criterion.first_turn is not None:
        turned = _find_first_turn(recording, criterion.x, criterion.y)
        if turned is None or (turned[1] == "towards") != (criterion.first_turn == "towards"):
            told = "it did not turn at all" if turned is None else f"it turned {_describe_direction(turned[1])} it"
            wished = f"Expected the robot first to turn {_describe_direction(criterion.first_turn)}"
            return fail_with(
                f"{wished} {point}, but {told}.", *find_place(recording, turned[0] if turned else 0), measures=measures
            )
    if criterion.distance is not None and not criterion.distance[0] <= least <= criterion.distance[1]:
        low, high = criterion.distance
        return fail_with(
            f"Expected the robot's smallest distance to {point} to be {low:g} to {high:g} mm, but it was {least:.0f} "
            "mm.",
            *where,
            measures=measures,
        )
    if criterion.than_straight is not None and (least < straight) != (criterion.than_straight == "nearer"):
        wish = "come nearer to" if criterion.than_straight == "nearer" else "stay farther from"
        return fail_with(
            f"Expected the robot to {wish} {point} than by driving straight on ({straight:.0f} mm), but its smallest "
            f"distance was {least:.0f} mm.",
            *where,
            measures=measures,
        )
    return pass_with(f"The robot's smallest distance to {point} was {least:.0f} mm.", *where, measures)


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
    left = (bearing - start.heading + 180) % 360 - 180 > 0
    return row, "towards" if (degrees[row] > degrees[0]) == left else "away"


def _measure_straight_distance(recording: Recording, x: float, y: float) -> float:
    """Return the least distance from a point to the ray ahead of the start, mm."""
    start = recording.start
    along = math.radians(start.heading)
    end = (start.x + _FAR * math.cos(along), start.y + _FAR * math.sin(along))
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
    round_it = compute_rounds(compute_positions(recording, criterion.of), criterion.x, criterion.y)
    times = float(abs(round_it[-1])) if len(round_it) else 0.0
    measures = [Measure("times round", times)]
    point, end = f"({criterion.x:g}, {criterion.y:g})", (recording.end_t, recording.end)
    low, high = criterion.times
    wanted = f"{low:g} times" if low == high else f"{low:g} to {high:g} times"
    if high >= _NO_BOUND:
        wanted = "at least once" if low == 1 else f"at least {low:g} times"
    if criterion.direction != "either" and times >= 0.5:
        went = "anticlockwise" if round_it[-1] > 0 else "clockwise"
        if went != criterion.direction:
            return fail_with(
                f"Expected the path to go {criterion.direction} round {point}, but it went {went}.",
                *end,
                measures=tuple(measures),
            )
    if not low <= times <= high:
        drawn = "" if len(round_it) else "; the pen was never down, which -p in the program's magic line does"
        score = Fraction(min(times / low, 1.0) if low else 0.0).limit_denominator(1000)
        return fail_with(
            f"Expected the path to go {wanted} round {point}, but it went {times:.2f} times{drawn}.",
            *end,
            score=score,
            measures=tuple(measures),
        )
    nearest = float(
        np.nanmin(
            np.hypot(*(compute_positions(recording, criterion.of) - (criterion.x, criterion.y)).T), initial=np.inf
        )
    )
    if nearest < criterion.clear_of:
        return fail_with(
            f"Expected the path to keep {criterion.clear_of:g} mm clear of {point}, but its smallest distance was "
            f"{nearest:.0f} mm.",
            *end,
            measures=tuple(measures),
        )
    for number, (first, last) in enumerate(_find_complete_rounds(round_it), 1):
        turned = compute_headings(recording)[first : last + 1]
        change = float(abs(turned[-1] - turned[0]))
        corners = _count_corners(turned)
        measures += [Measure(f"gyro in round {number}", change, "°"), Measure(f"corners in round {number}", corners)]
        if criterion.gyro is not None and not criterion.gyro[0] <= change <= criterion.gyro[1]:
            return fail_with(
                f"Expected the gyro to change by {criterion.gyro[0]:g}° to {criterion.gyro[1]:g}° in each round, "
                f"but in round {number} it changed by {change:.0f}°.",
                *find_place(recording, last),
                measures=tuple(measures),
            )
        if criterion.corners is not None and corners != criterion.corners:
            return fail_with(
                f"Expected the gyro to change in {criterion.corners} steps in each round, "
                f"but in round {number} there were {corners}.",
                *find_place(recording, last),
                measures=tuple(measures),
            )
    return pass_with(f"The path went {times:.2f} times round {point}.", *end, tuple(measures))


def compute_rounds(points: Floats, x: float, y: float) -> Floats:
    """Return the rounds about (x, y) up to each row, anticlockwise positive.

    Rows with NaN (pen up) are left out.
    """
    drawn = points[~np.isnan(points[:, 0])]
    if not len(drawn):
        return np.zeros(0)
    angles = np.unwrap(np.arctan2(drawn[:, 1] - y, drawn[:, 0] - x))
    return np.asarray((angles - angles[0]) / (2 * np.pi))


def _find_complete_rounds(round_it: Floats) -> list[tuple[int, int]]:
    """Return the first and last row of each complete round."""
    farthest = np.maximum.accumulate(np.abs(round_it))
    ends = np.searchsorted(farthest, np.arange(1, int(farthest.max(initial=0.0)) + 1)).tolist()
    return list(zip([0, *ends], ends, strict=False))


def _count_corners(turned: Floats) -> int:
    """Return the number of corners: parts with above-average turning, at least 0.5 s apart and 30 degrees each."""
    if len(turned) <= _SMOOTH:
        return 0
    smooth = np.convolve(turned, np.ones(_SMOOTH) / _SMOOTH, mode="valid")
    rate = np.diff(smooth) * np.sign(turned[-1] - turned[0])
    fast = rate > rate.mean()
    for first, last in find_true_runs(~fast):
        if last - first < _LASTING and first > 0 and last < len(fast):
            fast[first:last] = True
    return sum(abs(float(smooth[last] - smooth[first])) >= _CORNER for first, last in find_true_runs(fast))


@declare_case_judge(Spread)
def judge_spread(criterion: Spread, case: Case) -> CriterionResult:
    """Judge the spread of the end positions. If no marks were lost, the message has all measurements."""

    def told(trials: IndexedTrials, outcomes: Sequence[Outcome]) -> str:
        if trials and all(outcome.passed for outcome in outcomes):
            return _describe_spread(criterion, [trial for _, trial in trials])
        return summarise_trials(trials, outcomes)

    return judge_by_trial(criterion, case, lambda _, trial: _judge_end(criterion, trial), told)


def _judge_end(criterion: Spread, trial: TrialResult) -> Outcome:
    """Judge the distance of the end from the point, mm."""
    recording = trial.recording
    distance = _measure_end_distance(criterion, trial)
    measures = (Measure("distance from the target", distance, "mm"),)
    told = f"ended {distance:.0f} mm from ({criterion.x:g}, {criterion.y:g})"
    if criterion.within is not None and not distance <= criterion.within:
        return fail_with(
            f"Expected the robot to end within {criterion.within:g} mm of ({criterion.x:g}, {criterion.y:g}), "
            f"but it ended {distance:.0f} mm from it.",
            recording.end_t,
            recording.end,
            measures=measures,
        )
    return pass_with(f"The robot {told}.", recording.end_t, recording.end, measures)


def _describe_spread(criterion: Spread, trials: Sequence[TrialResult]) -> str:
    """Return the least, mean and greatest distance for each level of motor noise."""
    levels = sorted({trial.motor_noise for trial in trials})
    told = []
    for level in levels:
        distances = [_measure_end_distance(criterion, trial) for trial in trials if trial.motor_noise == level]
        mean = sum(distances) / len(distances)
        told.append(
            f"with motor noise {level:g} {min(distances):.0f} to {max(distances):.0f} mm (mean {mean:.0f}, "
            f"{len(distances)} run{'' if len(distances) == 1 else 's'})"
        )
    return f"The robot ended at these distances from ({criterion.x:g}, {criterion.y:g}): {'; '.join(told)}."


def _measure_end_distance(criterion: Spread, trial: TrialResult) -> float:
    end = trial.recording.end
    return math.hypot(end.x - criterion.x, end.y - criterion.y)
