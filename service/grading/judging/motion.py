"""Judging of motion: overall, move by move, there and back, and after a sensor reading.

``moves.py`` finds the moves. ``path.py`` judges where on the floor the robot went.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from fractions import Fraction

import numpy as np
from numpy.typing import NDArray

from service.grading.grade import Measure, TrialResult
from service.grading.judging.geometry import (
    compute_positions,
    compute_still_mask,
    compute_times,
    compute_travel,
    find_place,
    find_true_runs,
)
from service.grading.judging.judge_declaration import declare_judge
from service.grading.judging.matching import match_most_in_order, match_most_pairs
from service.grading.judging.moves import (
    Move,
    build_move,
    build_move_measures,
    describe_mismatch,
    describe_range,
    format_number,
    orient_range,
    split_moves,
)
from service.grading.judging.outcome import Outcome, fail_with, pass_with
from sim.camera import HEIGHT, WIDTH
from sim.recording import Floats, Recording
from sim.recording_values import get_recorded_robot
from submissions.criteria.motion import Displacement, Encounters, Excursions, Moves, NamedMotion

#: The smallest height of a turning point above the path around it, mm.
_MIN_MOTION = 5.0
#: The smallest reversal (mm), turn (degrees) and stop (ticks) that count after an encounter.
_REVERSED, _TURNED, _STOPPED = 5.0, 15.0, 3


@declare_judge(Displacement)
def judge_displacement(criterion: Displacement, trial: TrialResult) -> Outcome:
    """Judge the motion from start to end. Wheel positions are those that the program would read at the end."""
    recording = trial.recording
    whole = build_move(recording, 0, len(recording.ticks))
    left, right = _read_wheel_positions(recording)
    expected = abs(left) / 360 * math.pi * get_recorded_robot(recording).wheel_diameter
    measures = (
        Measure("displacement", whole.distance, "mm"),
        Measure("displacement forward", whole.forward, "mm"),
        Measure("displacement sideways", whole.sideways, "mm"),
        Measure("heading change", whole.turn, "°"),
        Measure("left wheel", left, "°"),
        Measure("right wheel", right, "°"),
    )
    t, end = recording.end_t, recording.end
    missed = describe_mismatch(criterion, whole)
    if missed is not None:
        return fail_with(f"Expected, from start to end, {missed}.", t, end, measures=measures)
    for side, wished, value in (("left", criterion.left_wheel, left), ("right", criterion.right_wheel, right)):
        if wished is not None and not wished[0] <= value <= wished[1]:
            return fail_with(
                f"Expected the {side} wheel's position to be {wished[0]:g} to {wished[1]:g} at the end, "
                f"but it was {value:.0f}.",
                t,
                end,
                measures=measures,
            )
    share = criterion.agrees_with_wheels
    if share is not None and not abs(whole.distance - expected) <= share * max(expected, 1e-9):
        return fail_with(
            f"Expected the robot to drive {expected:.0f} mm according to its left wheel's position (within "
            f"{share:.0%}), but it ended {whole.distance:.0f} mm from its start.",
            t,
            end,
            measures=measures,
        )
    return pass_with(f"From start to end the robot {whole}.", t, end, measures)


@declare_judge(Moves)
def judge_moves(criterion: Moves, trial: TrialResult) -> Outcome:
    """Judge the moves by searching for each required one among those that were made."""
    recording = trial.recording
    made = split_moves(recording)
    found = _match_moves(criterion, made)
    score = Fraction(sum(move is not None for move in found), len(found))
    measures = tuple(
        measure
        for number, move in enumerate(found, 1)
        if move is not None
        for measure in build_move_measures(move, f"move {number}")
    )
    missing = next((number for number, move in enumerate(found) if move is None), None)
    if missing is not None:
        return _fail_for_missing_move(criterion, recording, made, found, missing, score, measures)
    others = [move for move in made if move not in found]
    if criterion.only and others:
        expected = f"only the {_format_count(len(found), 'move')} expected"
        return fail_with(
            f"Expected {expected}, but the robot also {others[0]}.",
            *find_place(recording, others[0].first),
            score=score,
            measures=measures,
        )
    told = "; ".join(str(move) for move in found[:4] if move is not None)
    return pass_with(f"The robot moved as expected: it {told}.", *find_place(recording, made[-1].last), measures)


@declare_judge(Excursions)
def judge_excursions(criterion: Excursions, trial: TrialResult) -> Outcome:
    """Judge the peaks of the motion along the start's heading, and the distance from the start after each."""
    recording = trial.recording
    ahead = _compute_distance_ahead(recording)
    turns = _find_turning_points(ahead)
    outs = [turn for turn in turns if turn.is_outward]
    wanted = len(criterion.heights)
    measures = tuple(
        Measure(f"{'peak' if turn.is_outward else 'return'} {number}", float(ahead[turn.row]), "mm")
        for out in (True, False)
        for number, turn in enumerate((turn for turn in turns if turn.is_outward is out), 1)
    )[:24]
    right = Fraction(min(len(outs), wanted), wanted) / 2
    if len(outs) != wanted:
        row = turns[-1].row if turns else 0
        return fail_with(
            f"Expected the robot to go out and come back {_format_times(wanted)}, but it "
            f"{_describe_repetitions(len(outs))}.",
            *find_place(recording, row),
            score=right,
            measures=measures,
        )
    unit = sum(abs(float(ahead[turn.row])) for turn in outs) / sum(criterion.heights)
    for number, (turn, height) in enumerate(zip(outs, criterion.heights, strict=True), 1):
        reached = abs(float(ahead[turn.row]))
        share = height / criterion.heights[0]
        least = criterion.at_least * share
        if reached < least:
            return fail_with(
                f"Expected the robot to go out at least {least:g} mm the {_format_ordinal(number)} time, "
                f"but it went {reached:.0f} mm.",
                *find_place(recording, turn.row),
                score=right,
                measures=measures,
            )
        if abs(reached - unit * height) > criterion.tolerance * unit * height:
            ways = ", ".join(f"{abs(float(ahead[each.row])):.0f}" for each in outs)
            return fail_with(
                f"Expected the robot to go out {_describe_proportion(criterion.heights)} (within "
                f"{criterion.tolerance:.0%}), "
                f"but it went {ways} mm.",
                *find_place(recording, turn.row),
                score=right,
                measures=measures,
            )
    away = np.hypot(*(compute_positions(recording) - (recording.start.x, recording.start.y)).T)
    # The last return counts at the end of the run, not at the nearest earlier point.
    back = [*[turn.row for turn in turns if not turn.is_outward][: wanted - 1], len(ahead) - 1]
    for number, row in enumerate(back, 1):
        if away[row] > criterion.returns_within:
            came = f"the {_format_ordinal(number)} time it came back to {format_number(float(away[row]))} mm"
            return fail_with(
                f"Expected the robot to come back to within {criterion.returns_within:g} mm of its start each time, "
                f"but {came if number < wanted else f'it ended {format_number(float(away[row]))} mm from it'}.",
                *find_place(recording, row),
                score=right + Fraction(number - 1, 2 * wanted),
                measures=measures,
            )
    return pass_with(
        f"The robot went out and came back {_format_times(wanted)}, {abs(float(ahead[outs[0].row])):.0f} mm the "
        "first time, "
        f"and ended {format_number(float(away[-1]))} mm from its start.",
        recording.end_t,
        recording.end,
        measures,
    )


@declare_judge(Encounters)
def judge_encounters(criterion: Encounters, trial: TrialResult) -> Outcome:
    """Judge the robot's reaction in the seconds after each fall of the reading below the threshold."""
    recording = trial.recording
    falls = _find_falls(criterion, recording)
    answered = _find_answered_falls(criterion, recording, falls)
    measures = (Measure("encounters", len(falls)), Measure("answered", len(answered)))
    score = Fraction(min(len(answered), criterion.at_least), criterion.at_least)
    if len(answered) >= criterion.at_least:
        return pass_with(
            f"The robot saw something dark {_format_times(len(falls))}, and reacted as expected "
            f"{_format_times(len(answered))}.",
            *find_place(recording, answered[-1]),
            measures,
        )
    what = " and then ".join(criterion.then)
    expected = f"Expected the robot to {what} {_format_times(criterion.at_least)} after seeing something dark"
    ignored = min(set(falls).difference(answered), default=None)
    if ignored is not None:
        return fail_with(
            f"{expected}, but it {_describe_repetitions(len(answered))}; this is the first time without a reaction.",
            *find_place(recording, ignored),
            score=score,
            measures=measures,
        )
    sensor = "a light sensor" if criterion.light == "either" else f"its {criterion.light} light sensor"
    fell = (
        f"fell below {criterion.below:g} % only {_format_times(len(falls))}"
        if falls
        else f"never fell below {criterion.below:g} %"
    )
    return fail_with(
        f"{expected}, but the reading of {sensor} {fell}.",
        recording.end_t,
        recording.end,
        score=score,
        measures=measures,
    )


@dataclass(frozen=True, slots=True)
class _TurningPoint:
    """A change from going out to coming back (``out``), or the reverse."""

    row: int
    is_outward: bool


def _find_turning_points(ahead: Floats) -> list[_TurningPoint]:
    """Return peaks and returns alternately, beginning with the first way out, ending with the last row.

    A change of direction counts from 5 mm on. A last way out without a return ends in a peak.
    """
    turns: list[_TurningPoint] = []
    sign = 0.0  # the side of the current excursion, 0 before the first
    extreme, going_out = 0, True
    for row, value in enumerate(ahead):
        if not sign:
            if abs(value) >= _MIN_MOTION:
                sign, extreme = math.copysign(1, value), row
            continue
        away, best = sign * float(value), sign * float(ahead[extreme])
        if (away > best) if going_out else (away < best):
            extreme = row
        elif abs(away - best) >= _MIN_MOTION:
            turns.append(_TurningPoint(extreme, going_out))
            going_out, extreme = not going_out, row
    if sign:
        turns.append(_TurningPoint(extreme, going_out))
    return turns


def _match_moves(criterion: Moves, made: tuple[Move, ...]) -> list[Move | None]:
    """Return the move matched to each required one, with as many matches as possible."""
    suits = [[describe_mismatch(wanted, move) is None for move in made] for wanted in criterion.moves]

    def first_from(wish: int, start: int) -> int | None:
        return next((place for place in range(start, len(made)) if suits[wish][place]), None)

    places = match_most_in_order(len(suits), first_from) if criterion.in_order else match_most_pairs(suits)
    return [None if place is None else made[place] for place in places]


def _fail_for_missing_move(
    criterion: Moves,
    recording: Recording,
    made: tuple[Move, ...],
    found: list[Move | None],
    number: int,
    score: Fraction,
    measures: tuple[Measure, ...],
) -> Outcome:
    """Return the outcome for a missing move, with the move that was made instead."""
    wanted = criterion.moves[number]
    called = f"{wanted.name}: " if wanted.name else ""
    after = max((made.index(move) for move in found[:number] if move is not None), default=-1) + 1
    free = [move for move in made[after if criterion.in_order else 0 :] if move not in found]
    if not free:
        told = f"did not: in its last move it {made[-1]}" if made else "did not move at all"
        return fail_with(
            f"Expected {called}{_describe_required_move(wanted)}, but the robot {told}.",
            recording.end_t,
            recording.end,
            score,
            measures,
        )
    near = min(free, key=lambda move: _count_missed_conditions(wanted, move)) if not criterion.in_order else free[0]
    return fail_with(
        f"Expected {called}{_describe_required_move(wanted)}, but the robot {near}.",
        *find_place(recording, near.last),
        score=score,
        measures=measures or build_move_measures(near, "this move"),
    )


def _describe_required_move(wanted: NamedMotion) -> str:
    asked = (
        ("forwards", "backwards", wanted.forward, " mm"),
        ("to the left", "to the right", wanted.sideways, " mm"),
        ("away from where it began", "", wanted.distance, " mm"),
        ("of turn to the left", "of turn to the right", wanted.turn, "°"),
        ("of turn", "", wanted.turn_size, "°"),
        ("long", "", wanted.seconds, " s"),
    )
    words = []
    for positive, negative, wished, unit in asked:
        if wished is not None:
            what, least, most = orient_range(wished, positive, negative)
            words.append(f"{describe_range(least, most, unit)} {what}")
    return f"a move of {', '.join(words)}"


def _describe_proportion(heights: tuple[float, ...]) -> str:
    if len(set(heights)) == 1:
        return "equally far each time"
    return f"in the proportion {' to '.join(f'{height:g}' for height in heights)}"


def _count_missed_conditions(wanted: NamedMotion, move: Move) -> int:
    """Return how many of the conditions a move misses."""
    parts = ("forward", "sideways", "distance", "turn", "turn_size", "seconds")
    given = (part for part in parts if getattr(wanted, part) is not None)
    return sum(describe_mismatch(NamedMotion(**{part: getattr(wanted, part)}), move) is not None for part in given)


def _compute_distance_ahead(recording: Recording) -> Floats:
    """Return the distance ahead of the start, along its heading, mm, shape (n + 1,)."""
    along = math.radians(recording.start.heading)
    away = compute_positions(recording) - np.array([recording.start.x, recording.start.y])
    return np.asarray(away @ np.array([math.cos(along), math.sin(along)]))


def _read_wheel_positions(recording: Recording) -> tuple[float, float]:
    ticks = recording.ticks
    return (float(ticks.left_position[-1]), float(ticks.right_position[-1])) if len(ticks) else (0.0, 0.0)


def _find_falls(criterion: Encounters, recording: Recording) -> list[int]:
    """Return the rows at which a sensor's reading fell below the threshold. Readings off the floor don't count."""
    ticks = recording.ticks
    readings = {"left": ticks.left_rgb, "right": ticks.right_rgb}
    dark: NDArray[np.bool_] = np.zeros(len(ticks), dtype=bool)
    for side, rgb in readings.items():
        if criterion.light in (side, "either"):
            x, y = compute_positions(recording, "left_light" if side == "left" else "right_light")[1:].T
            edge = get_recorded_robot(recording).left_light.diameter / 2
            on_floor = (x >= edge) & (x <= WIDTH - edge) & (y >= edge) & (y <= HEIGHT - edge)
            dark |= on_floor & (rgb[:, 0] / 255 * 100 < criterion.below)
    return [first + 1 for first, _ in find_true_runs(dark)]


def _find_answered_falls(criterion: Encounters, recording: Recording, falls: list[int]) -> list[int]:
    """Return the falls after which everything required happened in order and in time."""
    ahead, turned = compute_travel(recording)
    motion = _Motion(-np.minimum(ahead, 0), turned, compute_still_mask(recording))
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


def _has_all_reactions(deeds: tuple[str, ...], motion: _Motion, begin: int, end: int) -> bool:
    for deed in deeds:
        since = slice(begin, end)
        if deed == "reverse":
            reached = np.cumsum(motion.backwards[since]) >= _REVERSED
        elif deed == "turn":
            reached = np.abs(np.cumsum(motion.turned[since])) >= _TURNED
        else:
            stood = np.cumsum(motion.still[since])
            reached = stood - np.concatenate([np.zeros(_STOPPED, dtype=int), stood])[: len(stood)] >= _STOPPED
        if not reached.any():
            return False
        begin += int(np.argmax(reached)) + 1
    return True


def _format_times(count: int) -> str:
    return {0: "never", 1: "once", 2: "twice"}.get(count, f"{count} times")


def _describe_repetitions(count: int) -> str:
    return f"did so {_format_times(count)}" if count else "never did"


def _format_ordinal(number: int) -> str:
    return {1: "first", 2: "second", 3: "third"}.get(number, f"{number}th")


def _format_count(number: int, what: str) -> str:
    return f"{number} {what}{'' if number == 1 else 's'}"
