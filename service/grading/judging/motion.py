"""Judging of motion: overall, move by move, there and back, and after a sensor reading.

``moves.py`` finds the moves, ``turning_points.py`` the ways out and back, and ``reactions.py`` what follows a reading.
``path.py`` judges where the robot went.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from fractions import Fraction
from types import MappingProxyType

import numpy as np

from service.grading.findings import OtherMove, OtherSide, OtherTurn
from service.grading.grade import Measure, TrialResult
from service.grading.judging.geometry import (
    compute_positions,
    find_place,
)
from service.grading.judging.judge_declaration import declare_judge
from service.grading.judging.matching import match_maximum_in_order, match_maximum_pairs
from service.grading.judging.message_parts import join_with_semicolons
from service.grading.judging.motion_descriptions import (
    describe_occurrence,
    describe_proportion,
    describe_reactions,
    describe_reading,
    describe_repetitions,
    format_times,
)
from service.grading.judging.moves import (
    Move,
    build_move,
    build_move_measures,
    count_missed_conditions,
    describe_required_move,
    find_mismatch,
    format_number,
    split_moves,
)
from service.grading.judging.outcome import Outcome, fail_with, pass_with
from service.grading.judging.reactions import find_answered_falls, find_falls
from service.grading.judging.turning_points import find_turning_points
from service.language import translatable
from sim.recording import Floats, Recording
from sim.recording_values import get_recorded_robot
from sim.sentences import Sentence
from submissions.criteria.motion import Displacement, Encounters, Excursions, Moves

_WHEEL_PROBLEMS: Mapping[str, str] = MappingProxyType(
    {
        "left": translatable(
            "Expected the left wheel's position to be %(least)g to %(most)g at the end, but it was %(position).0f."
        ),
        "right": translatable(
            "Expected the right wheel's position to be %(least)g to %(most)g at the end, but it was %(position).0f."
        ),
    }
)


@declare_judge(Displacement)
def judge_displacement(criterion: Displacement, trial: TrialResult) -> Outcome:
    """Judge the motion from start to end. Wheel positions are those that the program would read at the end."""
    recording = trial.recording
    total_move = build_move(recording, 0, len(recording.ticks))
    left_position, right_position = _read_wheel_positions(recording)
    expected_distance = abs(left_position) / 360 * math.pi * get_recorded_robot(recording).wheel_diameter
    measures = (
        Measure(Sentence("displacement"), total_move.distance, "mm"),
        Measure(Sentence("displacement forward"), total_move.forward, "mm"),
        Measure(Sentence("displacement sideways"), total_move.sideways, "mm"),
        Measure(Sentence("heading change"), total_move.turn, "°"),
        Measure(Sentence("left wheel"), left_position, "°"),
        Measure(Sentence("right wheel"), right_position, "°"),
    )
    t, end = recording.end_t, recording.end
    mismatch = find_mismatch(criterion, total_move)
    if mismatch is not None:
        findings = (OtherSide(),) if mismatch.is_other_side else ()
        message = Sentence("Expected, from start to end, %(mismatch)s.", mismatch=mismatch.description)
        return fail_with(message, t, end, measures=measures, findings=findings)
    for side, bounds, value in (
        ("left", criterion.left_wheel, left_position),
        ("right", criterion.right_wheel, right_position),
    ):
        if bounds is not None and not bounds[0] <= value <= bounds[1]:
            return fail_with(
                Sentence(_WHEEL_PROBLEMS[side], least=bounds[0], most=bounds[1], position=value),
                t,
                end,
                measures=measures,
            )
    share = criterion.agrees_with_wheels
    if share is not None and not abs(total_move.distance - expected_distance) <= share * max(expected_distance, 1e-9):
        return fail_with(
            Sentence(
                "Expected the robot to drive %(expected).0f mm according to its left wheel's position (within "
                "%(tolerance)s), but it ended %(distance).0f mm from its start.",
                expected=expected_distance,
                tolerance=f"{share:.0%}",
                distance=total_move.distance,
            ),
            t,
            end,
            measures=measures,
        )
    message = Sentence("From start to end the robot %(move)s.", move=total_move.describe())
    return pass_with(message, t, end, measures)


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
        for measure in build_move_measures(move, Sentence("move %(number)s", number=number))
    )
    missing_index = next((number for number, move in enumerate(matched_moves) if move is None), None)
    if missing_index is not None:
        return _fail_for_missing_move(criterion, recording, moves, matched_moves, missing_index, score, measures)
    extra_moves = [move for move in moves if move not in matched_moves]
    if criterion.only and extra_moves:
        template = (
            translatable("Expected only the %(count)s move expected, but the robot also %(move)s.")
            if len(matched_moves) == 1
            else translatable("Expected only the %(count)s moves expected, but the robot also %(move)s.")
        )
        return fail_with(
            Sentence(template, count=len(matched_moves), move=extra_moves[0].describe()),
            *find_place(recording, extra_moves[0].first),
            score=score,
            measures=measures,
            findings=(OtherMove(extra_moves[0].seconds),),
        )
    description = join_with_semicolons([move.describe() for move in matched_moves[:4] if move is not None])
    message = Sentence("The robot moved as expected: it %(moves)s.", moves=description)
    return pass_with(message, *find_place(recording, moves[-1].last), measures)


@declare_judge(Excursions)
def judge_excursions(criterion: Excursions, trial: TrialResult) -> Outcome:
    """Judge the peaks of the motion along the start's heading, and the distance from the start after each."""
    recording = trial.recording
    forward_distances = _compute_distance_ahead(recording)
    turns = find_turning_points(forward_distances)
    peaks = [turn for turn in turns if turn.is_outward]
    required_count = len(criterion.heights)
    measures = tuple(
        Measure(Sentence(template, number=number), float(forward_distances[turn.row]), "mm")
        for template, out in ((translatable("peak %(number)s"), True), (translatable("return %(number)s"), False))
        for number, turn in enumerate((turn for turn in turns if turn.is_outward is out), 1)
    )[:24]
    half_score = Fraction(min(len(peaks), required_count), required_count) / 2
    if len(peaks) != required_count:
        row = turns[-1].row if turns else 0
        return fail_with(
            Sentence(
                "Expected the robot to go out and come back %(times)s, but it %(repetitions)s.",
                times=format_times(required_count),
                repetitions=describe_repetitions(len(peaks)),
            ),
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
                Sentence(
                    "Expected the robot to go out at least %(least)g mm %(time)s, but it went %(distance).0f mm.",
                    least=min_height,
                    time=describe_occurrence(number),
                    distance=peak_distance,
                ),
                *find_place(recording, turn.row),
                score=half_score,
                measures=measures,
            )
        if abs(peak_distance - unit * height) > criterion.tolerance * unit * height:
            distances = ", ".join(f"{abs(float(forward_distances[each.row])):.0f}" for each in peaks)
            return fail_with(
                Sentence(
                    "Expected the robot to go out %(proportion)s (within %(tolerance)s), but it went %(distances)s mm.",
                    proportion=describe_proportion(criterion.heights),
                    tolerance=f"{criterion.tolerance:.0%}",
                    distances=distances,
                ),
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
            template = (
                translatable(
                    "Expected the robot to come back to within %(limit)g mm of its start each time, but it ended "
                    "%(distance)s mm from it."
                )
                if number >= required_count
                else translatable(
                    "Expected the robot to come back to within %(limit)g mm of its start each time, but "
                    "%(time)s it came back to %(distance)s mm."
                )
            )
            return fail_with(
                Sentence(
                    template,
                    limit=criterion.returns_within,
                    time=describe_occurrence(number),
                    distance=format_number(float(start_distances[row])),
                ),
                *find_place(recording, row),
                score=half_score + Fraction(number - 1, 2 * required_count),
                measures=measures,
            )
    return pass_with(
        Sentence(
            "The robot went out and came back %(times)s, %(distance).0f mm the first time, and ended %(gap)s mm from "
            "its start.",
            times=format_times(required_count),
            distance=abs(float(forward_distances[peaks[0].row])),
            gap=format_number(float(start_distances[-1])),
        ),
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
    measures = (
        Measure(Sentence("encounters"), len(falls)),
        Measure(Sentence("answered"), len(answered_falls)),
    )
    score = Fraction(min(len(answered_falls), criterion.at_least), criterion.at_least)
    if len(answered_falls) >= criterion.at_least:
        return pass_with(
            Sentence(
                "The robot saw something dark %(times)s, and reacted as expected %(reaction_times)s.",
                times=format_times(len(falls)),
                reaction_times=format_times(len(answered_falls)),
            ),
            *find_place(recording, answered_falls[-1]),
            measures,
        )
    expectation = Sentence(
        "Expected the robot to %(reactions)s %(times)s after seeing something dark",
        reactions=describe_reactions(criterion.then),
        times=format_times(criterion.at_least),
    )
    ignored_fall = min(set(falls).difference(answered_falls), default=None)
    if ignored_fall is not None:
        return fail_with(
            Sentence(
                "%(expectation)s, but it %(repetitions)s; this is the first time without a reaction.",
                expectation=expectation,
                repetitions=describe_repetitions(len(answered_falls)),
            ),
            *find_place(recording, ignored_fall),
            score=score,
            measures=measures,
        )
    template = (
        translatable("%(expectation)s, but %(reading)s fell below %(threshold)g %% only %(times)s.")
        if falls
        else translatable("%(expectation)s, but %(reading)s never fell below %(threshold)g %%.")
    )
    return fail_with(
        Sentence(
            template,
            expectation=expectation,
            reading=describe_reading(criterion.light),
            threshold=criterion.below,
            times=format_times(len(falls)),
        ),
        recording.end_t,
        recording.end,
        score=score,
        measures=measures,
    )


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
    expected_move = describe_required_move(required_move)
    start = max((moves.index(move) for move in matched_moves[:number] if move is not None), default=-1) + 1
    free_moves = [move for move in moves[start if criterion.in_order else 0 :] if move not in matched_moves]
    if not free_moves:
        message = Sentence("Expected %(expected)s, but the robot did not move at all.", expected=expected_move)
        if moves:
            message = Sentence(
                "Expected %(expected)s, but the robot did not: in its last move it %(move)s.",
                expected=expected_move,
                move=moves[-1].describe(),
            )
        return fail_with(
            message,
            recording.end_t,
            recording.end,
            score,
            measures,
            findings=(OtherMove(moves[-1].seconds),) if moves else (),
        )
    closest_move = (
        min(free_moves, key=lambda move: count_missed_conditions(required_move, move))
        if not criterion.in_order
        else free_moves[0]
    )
    return fail_with(
        Sentence(
            "Expected %(expected)s, but the robot %(move)s.", expected=expected_move, move=closest_move.describe()
        ),
        *find_place(recording, closest_move.last),
        score=score,
        measures=measures or build_move_measures(closest_move, Sentence("this move")),
        findings=(OtherMove(closest_move.seconds), OtherTurn(abs(closest_move.turn))),
    )


def _compute_distance_ahead(recording: Recording) -> Floats:
    """Return the distance ahead of the start, along its heading, mm, shape (n + 1,)."""
    heading = math.radians(recording.start.heading)
    offsets = compute_positions(recording) - np.array([recording.start.x, recording.start.y])
    return np.asarray(offsets @ np.array([math.cos(heading), math.sin(heading)]))


def _read_wheel_positions(recording: Recording) -> tuple[float, float]:
    ticks = recording.ticks
    return (float(ticks.left_position[-1]), float(ticks.right_position[-1])) if len(ticks) else (0.0, 0.0)
