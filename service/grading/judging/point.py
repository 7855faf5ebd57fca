"""Judging relative to a point of the floor: closest approach, rounds, and the distance of the end.

``path.py`` judges places to visit or to avoid.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from fractions import Fraction
from types import MappingProxyType

import numpy as np

from service.grading.findings import OtherSide
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
from service.grading.judging.message_parts import join_with_semicolons
from service.grading.judging.outcome import Outcome, fail_with, pass_with
from service.language import translatable
from sim.recording import Floats, Recording
from sim.sentences import Sentence
from submissions.criteria.point import Circuits, Closest, Spread

_RAY_LENGTH = 10_000.0
_TURN = 2.0
#: By the required direction of the first turn: the problem with a turn in the other direction, and with no turn.
_TURN_PROBLEMS: Mapping[str, tuple[str, str]] = MappingProxyType(
    {
        "towards": (
            translatable("Expected the robot first to turn towards %(point)s, but it turned away from it."),
            translatable("Expected the robot first to turn towards %(point)s, but it did not turn at all."),
        ),
        "away": (
            translatable("Expected the robot first to turn away from %(point)s, but it turned towards it."),
            translatable("Expected the robot first to turn away from %(point)s, but it did not turn at all."),
        ),
    }
)


@declare_judge(Closest)
def judge_closest(criterion: Closest, trial: TrialResult) -> Outcome:
    """Judge the least distance of the robot's centre to a point, and its first turn relative to the point."""
    recording = trial.recording
    points = compute_positions(recording)
    nearest = _find_nearest(np.hypot(points[:, 0] - criterion.x, points[:, 1] - criterion.y))
    row, min_distance = nearest if nearest else (0, math.nan)
    straight_distance = _measure_straight_distance(recording, criterion.x, criterion.y)
    measures = (
        Measure(Sentence("least distance"), min_distance, "mm"),
        Measure(Sentence("straight on"), straight_distance, "mm"),
    )
    point = _format_point(criterion)
    moment = find_place(recording, row)
    if criterion.first_turn is not None:
        first_turn = _find_first_turn(recording, criterion.x, criterion.y)
        if first_turn is None or (first_turn[1] == "towards") != (criterion.first_turn == "towards"):
            other_turn, no_turn = _TURN_PROBLEMS[criterion.first_turn]
            return fail_with(
                Sentence(other_turn if first_turn else no_turn, point=point),
                *find_place(recording, first_turn[0] if first_turn else 0),
                measures=measures,
                findings=(OtherSide(),) if first_turn else (),
            )
    if criterion.distance is not None and not criterion.distance[0] <= min_distance <= criterion.distance[1]:
        low, high = criterion.distance
        return fail_with(
            Sentence(
                "Expected the robot's smallest distance to %(point)s to be %(least)g to %(most)g mm, but it was "
                "%(distance).0f mm.",
                point=point,
                least=low,
                most=high,
                distance=min_distance,
            ),
            *moment,
            measures=measures,
        )
    if criterion.than_straight is not None and (min_distance < straight_distance) != (
        criterion.than_straight == "nearer"
    ):
        template = (
            translatable(
                "Expected the robot to come nearer to %(point)s than by driving straight on (%(straight).0f mm), but "
                "its smallest distance was %(distance).0f mm."
            )
            if criterion.than_straight == "nearer"
            else translatable(
                "Expected the robot to stay farther from %(point)s than by driving straight on (%(straight).0f mm), "
                "but its smallest distance was %(distance).0f mm."
            )
        )
        return fail_with(
            Sentence(template, point=point, straight=straight_distance, distance=min_distance),
            *moment,
            measures=measures,
        )
    message = Sentence(
        "The robot's smallest distance to %(point)s was %(distance).0f mm.", point=point, distance=min_distance
    )
    return pass_with(message, *moment, measures)


def _format_point(criterion: Closest | Circuits | Spread) -> str:
    return f"({criterion.x:g}, {criterion.y:g})"


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
    measures = [Measure(Sentence("times round"), times)]
    point, end = _format_point(criterion), (recording.end_t, recording.end)
    low, high = criterion.times
    if criterion.direction != "either" and times >= 0.5:
        direction = "anticlockwise" if rounds[-1] > 0 else "clockwise"
        if direction != criterion.direction:
            template = (
                translatable("Expected the path to go clockwise round %(point)s, but it went anticlockwise.")
                if direction == "anticlockwise"
                else translatable("Expected the path to go anticlockwise round %(point)s, but it went clockwise.")
            )
            return fail_with(
                Sentence(template, point=point),
                *end,
                measures=tuple(measures),
            )
    if not low <= times <= high:
        template = (
            translatable("Expected the path to go %(expected)s round %(point)s, but it went %(times).2f times.")
            if len(rounds)
            else translatable(
                "Expected the path to go %(expected)s round %(point)s, but it went %(times).2f times; the pen was "
                "never down, which -p in the program's magic line does."
            )
        )
        score = Fraction(min(times / low, 1.0) if low else 0.0).limit_denominator(1000)
        return fail_with(
            Sentence(template, expected=_describe_times(low, high), point=point, times=times),
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
            Sentence(
                "Expected the path to keep %(clearance)g mm clear of %(point)s, but its smallest distance was "
                "%(distance).0f mm.",
                clearance=criterion.clear_of,
                point=point,
                distance=min_distance,
            ),
            *end,
            measures=tuple(measures),
        )
    for number, (first_row, last_row) in enumerate(_find_complete_rounds(rounds), 1):
        headings = compute_headings(recording)[first_row : last_row + 1]
        change = float(abs(headings[-1] - headings[0]))
        corners = _count_corners(headings)
        measures += [
            Measure(Sentence("gyro in round %(number)s", number=number), change, "°"),
            Measure(Sentence("corners in round %(number)s", number=number), corners),
        ]
        if criterion.gyro is not None and not criterion.gyro[0] <= change <= criterion.gyro[1]:
            return fail_with(
                Sentence(
                    "Expected the gyro to change by %(least)g° to %(most)g° in each round, but in round %(number)s it "
                    "changed by %(change).0f°.",
                    least=criterion.gyro[0],
                    most=criterion.gyro[1],
                    number=number,
                    change=change,
                ),
                *find_place(recording, last_row),
                measures=tuple(measures),
            )
        if criterion.corners is not None and corners != criterion.corners:
            return fail_with(
                Sentence(
                    "Expected the gyro to change in %(expected)s steps in each round, but in round %(number)s there "
                    "were %(count)s.",
                    expected=criterion.corners,
                    number=number,
                    count=corners,
                ),
                *find_place(recording, last_row),
                measures=tuple(measures),
            )
    message = Sentence("The path went %(times).2f times round %(point)s.", times=times, point=point)
    return pass_with(message, *end, tuple(measures))


def _describe_times(least: float, most: float) -> str:
    """Return the required rounds as ``2 times``, ``1 to 2 times``, ``at least once`` or ``at least 2 times``."""
    if most >= _NO_BOUND:
        return Sentence("at least once") if least == 1 else Sentence("at least %(count)g times", count=least)
    if least == most:
        return Sentence("%(count)g times", count=least)
    return Sentence("%(least)g to %(most)g times", least=least, most=most)


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
    measures = (Measure(Sentence("distance from the target"), distance, "mm"),)
    if criterion.within is not None and not distance <= criterion.within:
        return fail_with(
            Sentence(
                "Expected the robot to end within %(limit)g mm of %(point)s, but it ended %(distance).0f mm from it.",
                limit=criterion.within,
                point=_format_point(criterion),
                distance=distance,
            ),
            recording.end_t,
            recording.end,
            measures=measures,
        )
    message = Sentence(
        "The robot ended %(distance).0f mm from %(point)s.", distance=distance, point=_format_point(criterion)
    )
    return pass_with(message, recording.end_t, recording.end, measures)


def _describe_spread(criterion: Spread, trials: Sequence[TrialResult]) -> str:
    """Return the least, mean and greatest distance for each level of motor noise."""
    levels = sorted({trial.motor_noise for trial in trials})
    descriptions = []
    for level in levels:
        distances = [_measure_end_distance(criterion, trial) for trial in trials if trial.motor_noise == level]
        template = (
            translatable("with motor noise %(level)g %(least).0f to %(most).0f mm (mean %(mean).0f, %(count)s run)")
            if len(distances) == 1
            else translatable(
                "with motor noise %(level)g %(least).0f to %(most).0f mm (mean %(mean).0f, %(count)s runs)"
            )
        )
        descriptions.append(
            Sentence(
                template,
                level=level,
                least=min(distances),
                most=max(distances),
                mean=sum(distances) / len(distances),
                count=len(distances),
            )
        )
    return Sentence(
        "The robot ended at these distances from %(point)s: %(distances)s.",
        point=_format_point(criterion),
        distances=join_with_semicolons(descriptions),
    )


def _measure_end_distance(criterion: Spread, trial: TrialResult) -> float:
    end = trial.recording.end
    return math.hypot(end.x - criterion.x, end.y - criterion.y)
