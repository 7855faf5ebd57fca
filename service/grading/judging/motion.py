"""Judging of motion: overall, move by move, there and back, and after a sensor reading.

``moves.py`` finds the moves, ``reactions.py`` what follows a reading. ``path.py`` judges where the robot went.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from fractions import Fraction

import numpy as np

from service.grading.findings import OtherMove, OtherSide, OtherTurn
from service.grading.grade import Measure, TrialResult
from service.grading.judging.geometry import (
    compute_positions,
    find_place,
)
from service.grading.judging.judge_declaration import declare_judge
from service.grading.judging.matching import match_maximum_in_order, match_maximum_pairs
from service.grading.judging.moves import (
    Move,
    build_move,
    build_move_measures,
    describe_range,
    find_mismatch,
    format_number,
    orient_range,
    split_moves,
)
from service.grading.judging.outcome import Outcome, fail_with, pass_with
from service.grading.judging.reactions import find_answered_falls, find_falls
from sim.recording import Floats, Recording
from sim.recording_values import get_recorded_robot
from submissions.criteria.motion import Displacement, Encounters, Excursions, Moves, NamedMotion

#: The smallest height of a turning point above the path around it, mm.
_MIN_MOTION = 5.0


@declare_judge(Displacement)
def judge_displacement(criterion: Displacement, trial: TrialResult) -> Outcome:
    """Judge the motion from start to end. Wheel positions are those that the program would read at the end."""
    recording = trial.recording
    total_move = build_move(recording, 0, len(recording.ticks))
    left_position, right_position = _read_wheel_positions(recording)
    expected_distance = abs(left_position) / 360 * math.pi * get_recorded_robot(recording).wheel_diameter
    measures = (
        Measure("displacement", total_move.distance, "mm"),
        Measure("displacement forward", total_move.forward, "mm"),
        Measure("displacement sideways", total_move.sideways, "mm"),
        Measure("heading change", total_move.turn, "°"),
        Measure("left wheel", left_position, "°"),
        Measure("right wheel", right_position, "°"),
    )
    t, end = recording.end_t, recording.end
    mismatch = find_mismatch(criterion, total_move)
    if mismatch is not None:
        findings = (OtherSide(),) if mismatch.is_other_side else ()
        message = f"Expected, from start to end, {mismatch.words}."
        return fail_with(message, t, end, measures=measures, findings=findings)
    for side, bounds, value in (
        ("left", criterion.left_wheel, left_position),
        ("right", criterion.right_wheel, right_position),
    ):
        if bounds is not None and not bounds[0] <= value <= bounds[1]:
            return fail_with(
                f"Expected the {side} wheel's position to be {bounds[0]:g} to {bounds[1]:g} at the end, "
                f"but it was {value:.0f}.",
                t,
                end,
                measures=measures,
            )
    share = criterion.agrees_with_wheels
    if share is not None and not abs(total_move.distance - expected_distance) <= share * max(expected_distance, 1e-9):
        return fail_with(
            f"Expected the robot to drive {expected_distance:.0f} mm according to its left wheel's position (within "
            f"{share:.0%}), but it ended {total_move.distance:.0f} mm from its start.",
            t,
            end,
            measures=measures,
        )
    return pass_with(f"From start to end the robot {total_move}.", t, end, measures)


@declare_judge(Moves)
def judge_moves(criterion: Moves, trial: TrialResult) -> Outcome:
    """Judge the moves by searching for each required one among those that were made."""
    recording = trial.recording
    moves = split_moves(recording)
    matched_moves = _match_moves(criterion, moves)
    score = Fraction(sum(move is not None for move in matched_moves), len(matched_moves))
    measures = tuple(
        measure
        for number, move in enumerate(matched_moves, 1)
        if move is not None
        for measure in build_move_measures(move, f"move {number}")
    )
    missing_index = next((number for number, move in enumerate(matched_moves) if move is None), None)
    if missing_index is not None:
        return _fail_for_missing_move(criterion, recording, moves, matched_moves, missing_index, score, measures)
    extra_moves = [move for move in moves if move not in matched_moves]
    if criterion.only and extra_moves:
        expected = f"only the {_format_count(len(matched_moves), 'move')} expected"
        return fail_with(
            f"Expected {expected}, but the robot also {extra_moves[0]}.",
            *find_place(recording, extra_moves[0].first),
            score=score,
            measures=measures,
            findings=(OtherMove(extra_moves[0].seconds),),
        )
    description = "; ".join(str(move) for move in matched_moves[:4] if move is not None)
    return pass_with(
        f"The robot moved as expected: it {description}.", *find_place(recording, moves[-1].last), measures
    )


@declare_judge(Excursions)
def judge_excursions(criterion: Excursions, trial: TrialResult) -> Outcome:
    """Judge the peaks of the motion along the start's heading, and the distance from the start after each."""
    recording = trial.recording
    forward_distances = _compute_distance_ahead(recording)
    turns = _find_turning_points(forward_distances)
    peaks = [turn for turn in turns if turn.is_outward]
    required_count = len(criterion.heights)
    measures = tuple(
        Measure(f"{'peak' if turn.is_outward else 'return'} {number}", float(forward_distances[turn.row]), "mm")
        for out in (True, False)
        for number, turn in enumerate((turn for turn in turns if turn.is_outward is out), 1)
    )[:24]
    half_score = Fraction(min(len(peaks), required_count), required_count) / 2
    if len(peaks) != required_count:
        row = turns[-1].row if turns else 0
        return fail_with(
            f"Expected the robot to go out and come back {_format_times(required_count)}, but it "
            f"{_describe_repetitions(len(peaks))}.",
            *find_place(recording, row),
            score=half_score,
            measures=measures,
        )
    unit = sum(abs(float(forward_distances[turn.row])) for turn in peaks) / sum(criterion.heights)
    for number, (turn, height) in enumerate(zip(peaks, criterion.heights, strict=True), 1):
        peak_distance = abs(float(forward_distances[turn.row]))
        share = height / criterion.heights[0]
        min_height = criterion.at_least * share
        if peak_distance < min_height:
            return fail_with(
                f"Expected the robot to go out at least {min_height:g} mm the {_format_ordinal(number)} time, "
                f"but it went {peak_distance:.0f} mm.",
                *find_place(recording, turn.row),
                score=half_score,
                measures=measures,
            )
        if abs(peak_distance - unit * height) > criterion.tolerance * unit * height:
            distances = ", ".join(f"{abs(float(forward_distances[each.row])):.0f}" for each in peaks)
            return fail_with(
                f"Expected the robot to go out {_describe_proportion(criterion.heights)} (within "
                f"{criterion.tolerance:.0%}), but it went {distances} mm.",
                *find_place(recording, turn.row),
                score=half_score,
                measures=measures,
            )
    start_distances = np.hypot(*(compute_positions(recording) - (recording.start.x, recording.start.y)).T)
    # The last return counts at the end of the run, not at the nearest earlier point.
    return_rows = [
        *[turn.row for turn in turns if not turn.is_outward][: required_count - 1],
        len(forward_distances) - 1,
    ]
    for number, row in enumerate(return_rows, 1):
        if start_distances[row] > criterion.returns_within:
            distance = format_number(float(start_distances[row]))
            is_last = number >= required_count
            problem = (
                f"it ended {distance} mm from it"
                if is_last
                else f"the {_format_ordinal(number)} time it came back to {distance} mm"
            )
            return fail_with(
                f"Expected the robot to come back to within {criterion.returns_within:g} mm of its start each time, "
                f"but {problem}.",
                *find_place(recording, row),
                score=half_score + Fraction(number - 1, 2 * required_count),
                measures=measures,
            )
    return pass_with(
        f"The robot went out and came back {_format_times(required_count)}, "
        f"{abs(float(forward_distances[peaks[0].row])):.0f} mm the first time, and ended "
        f"{format_number(float(start_distances[-1]))} mm from its start.",
        recording.end_t,
        recording.end,
        measures,
    )


@declare_judge(Encounters)
def judge_encounters(criterion: Encounters, trial: TrialResult) -> Outcome:
    """Judge the robot's reaction in the seconds after each fall of the reading below the threshold."""
    recording = trial.recording
    falls = find_falls(criterion, recording)
    answered_falls = find_answered_falls(criterion, recording, falls)
    measures = (Measure("encounters", len(falls)), Measure("answered", len(answered_falls)))
    score = Fraction(min(len(answered_falls), criterion.at_least), criterion.at_least)
    if len(answered_falls) >= criterion.at_least:
        return pass_with(
            f"The robot saw something dark {_format_times(len(falls))}, and reacted as expected "
            f"{_format_times(len(answered_falls))}.",
            *find_place(recording, answered_falls[-1]),
            measures,
        )
    reactions = " and then ".join(criterion.then)
    expected = f"Expected the robot to {reactions} {_format_times(criterion.at_least)} after seeing something dark"
    ignored_fall = min(set(falls).difference(answered_falls), default=None)
    if ignored_fall is not None:
        return fail_with(
            f"{expected}, but it {_describe_repetitions(len(answered_falls))}; this is the first time without a "
            "reaction.",
            *find_place(recording, ignored_fall),
            score=score,
            measures=measures,
        )
    sensor = "a light sensor" if criterion.light == "either" else f"its {criterion.light} light sensor"
    reading_clause = (
        f"fell below {criterion.below:g} % only {_format_times(len(falls))}"
        if falls
        else f"never fell below {criterion.below:g} %"
    )
    return fail_with(
        f"{expected}, but the reading of {sensor} {reading_clause}.",
        recording.end_t,
        recording.end,
        score=score,
        measures=measures,
    )


@dataclass(frozen=True, slots=True)
class _TurningPoint:
    """A change from going out to coming back (``is_outward``), or the reverse."""

    row: int
    is_outward: bool


def _find_turning_points(forward_distances: Floats) -> list[_TurningPoint]:
    """Return peaks and returns alternately, beginning with the first way out, ending with the last row.

    A change of direction counts from 5 mm on. A last way out without a return ends in a peak.
    """
    turns: list[_TurningPoint] = []
    sign = 0.0  # the side of the current excursion, 0 before the first
    extreme, is_outward = 0, True
    for row, value in enumerate(forward_distances):
        if not sign:
            if abs(value) >= _MIN_MOTION:
                sign, extreme = math.copysign(1, value), row
            continue
        extent, best_extent = sign * float(value), sign * float(forward_distances[extreme])
        if (extent > best_extent) if is_outward else (extent < best_extent):
            extreme = row
        elif abs(extent - best_extent) >= _MIN_MOTION:
            turns.append(_TurningPoint(extreme, is_outward))
            is_outward, extreme = not is_outward, row
    if sign:
        turns.append(_TurningPoint(extreme, is_outward))
    return turns


def _match_moves(criterion: Moves, moves: tuple[Move, ...]) -> list[Move | None]:
    """Return the move matched to each required one, with as many matches as possible."""
    matches = [[find_mismatch(wanted, move) is None for move in moves] for wanted in criterion.moves]

    def find_next_match(wish: int, start: int) -> int | None:
        return next((place for place in range(start, len(moves)) if matches[wish][place]), None)

    places = (
        match_maximum_in_order(len(matches), find_next_match) if criterion.in_order else match_maximum_pairs(matches)
    )
    return [None if place is None else moves[place] for place in places]


def _fail_for_missing_move(
    criterion: Moves,
    recording: Recording,
    moves: tuple[Move, ...],
    matched_moves: list[Move | None],
    number: int,
    score: Fraction,
    measures: tuple[Measure, ...],
) -> Outcome:
    """Return the outcome for a missing move, with the move that was made instead."""
    required_move = criterion.moves[number]
    name_prefix = f"{required_move.name}: " if required_move.name else ""
    start = max((moves.index(move) for move in matched_moves[:number] if move is not None), default=-1) + 1
    free_moves = [move for move in moves[start if criterion.in_order else 0 :] if move not in matched_moves]
    if not free_moves:
        behaviour = f"did not: in its last move it {moves[-1]}" if moves else "did not move at all"
        return fail_with(
            f"Expected {name_prefix}{_describe_required_move(required_move)}, but the robot {behaviour}.",
            recording.end_t,
            recording.end,
            score,
            measures,
            findings=(OtherMove(moves[-1].seconds),) if moves else (),
        )
    closest_move = (
        min(free_moves, key=lambda move: _count_missed_conditions(required_move, move))
        if not criterion.in_order
        else free_moves[0]
    )
    return fail_with(
        f"Expected {name_prefix}{_describe_required_move(required_move)}, but the robot {closest_move}.",
        *find_place(recording, closest_move.last),
        score=score,
        measures=measures or build_move_measures(closest_move, "this move"),
        findings=(OtherMove(closest_move.seconds), OtherTurn(abs(closest_move.turn))),
    )


def _describe_required_move(required_move: NamedMotion) -> str:
    conditions = (
        ("forwards", "backwards", required_move.forward, " mm"),
        ("to the left", "to the right", required_move.sideways, " mm"),
        ("away from where it began", "", required_move.distance, " mm"),
        ("of turn to the left", "of turn to the right", required_move.turn, "°"),
        ("of turn", "", required_move.turn_size, "°"),
        ("long", "", required_move.seconds, " s"),
    )
    descriptions = []
    for positive, negative, bounds, unit in conditions:
        if bounds is not None:
            direction, minimum, maximum = orient_range(bounds, positive, negative)
            descriptions.append(f"{describe_range(minimum, maximum, unit)} {direction}")
    return f"a move of {', '.join(descriptions)}"


def _describe_proportion(heights: tuple[float, ...]) -> str:
    if len(set(heights)) == 1:
        return "equally far each time"
    return f"in the proportion {' to '.join(f'{height:g}' for height in heights)}"


def _count_missed_conditions(required_move: NamedMotion, move: Move) -> int:
    """Return how many of the conditions a move misses."""
    parts = ("forward", "sideways", "distance", "turn", "turn_size", "seconds")
    conditions = (part for part in parts if getattr(required_move, part) is not None)
    return sum(
        find_mismatch(NamedMotion(**{part: getattr(required_move, part)}), move) is not None for part in conditions
    )


def _compute_distance_ahead(recording: Recording) -> Floats:
    """Return the distance ahead of the start, along its heading, mm, shape (n + 1,)."""
    heading = math.radians(recording.start.heading)
    offsets = compute_positions(recording) - np.array([recording.start.x, recording.start.y])
    return np.asarray(offsets @ np.array([math.cos(heading), math.sin(heading)]))


def _read_wheel_positions(recording: Recording) -> tuple[float, float]:
    ticks = recording.ticks
    return (float(ticks.left_position[-1]), float(ticks.right_position[-1])) if len(ticks) else (0.0, 0.0)


def _format_times(count: int) -> str:
    return {0: "never", 1: "once", 2: "twice"}.get(count, f"{count} times")


def _describe_repetitions(count: int) -> str:
    return f"did so {_format_times(count)}" if count else "never did"


def _format_ordinal(number: int) -> str:
    return {1: "first", 2: "second", 3: "third"}.get(number, f"{number}th")


def _format_count(number: int, noun: str) -> str:
    return f"{number} {noun}{'' if number == 1 else 's'}"
