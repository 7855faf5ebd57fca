"""Division of a run into moves, with the measures of each.

This module only finds and measures moves. ``motion.py`` judges them.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType

import numpy as np
from numpy.typing import NDArray

from service.grading.grade import Measure
from service.grading.judging.geometry import (
    compute_still_mask,
    compute_travel,
    find_place,
    find_true_runs,
    to_relative_position,
)
from service.grading.judging.message_parts import join_with_commas
from service.language import translatable
from sim.recording import Recording
from sim.recording_values import get_recorded_robot, tick_to_seconds
from sim.sentences import Sentence, join_with_and
from submissions.criteria.motion import MotionConditions, NamedMotion

#: A smaller relative difference between the wheels counts as straight.
_STRAIGHT = 0.1
#: Two kinds of motion are separate moves if each lasts at least this many ticks (0.3 s).
_LASTING = 9
#: A bound this large (mm, degrees, s) means no bound, because no run reaches it.
_NO_BOUND = 10_000
#: A rest of at most this many ticks does not split a move.
_REST = 2


@dataclass(frozen=True, slots=True)
class Move:
    """One move: rows ``first`` to ``last`` of the recording, and its measures (mm, degrees, seconds)."""

    first: int
    last: int
    forward: float
    sideways: float
    turn: float
    seconds: float

    @property
    def distance(self) -> float:
        """The straight distance from the move's start to its end, mm."""
        return math.hypot(self.forward, self.sideways)

    def describe(self) -> str:
        """Return the move as ``turned 90.0° left and went 200 mm forwards in 2.00 s``."""
        clauses = []
        if abs(self.turn) >= 2:
            left, right = translatable("turned %(angle).1f° left"), translatable("turned %(angle).1f° right")
            clauses.append(Sentence(left if self.turn > 0 else right, angle=abs(self.turn)))
        if self.distance >= 5 or not clauses:
            ahead, back = (
                translatable("went %(distance).0f mm forwards"),
                translatable("went %(distance).0f mm backwards"),
            )
            clauses.append(Sentence(ahead if self.forward >= 0 else back, distance=abs(self.forward)))
        if abs(self.sideways) >= 5:
            left, right = translatable("%(distance).0f mm to its left"), translatable("%(distance).0f mm to its right")
            clauses.append(Sentence(left if self.sideways > 0 else right, distance=abs(self.sideways)))
        return Sentence("%(motion)s in %(seconds).2f s", motion=join_with_and(clauses), seconds=self.seconds)


def split_moves(recording: Recording) -> tuple[Move, ...]:
    """Return the moves of a run, in order.

    Moves are separated by standing still for more than two ticks. They are also separated by a change between driving
    forwards, backwards, turning left and turning right, if both last 0.3 s.
    """
    kinds = _classify_ticks(recording)
    return tuple(
        build_move(recording, first, last)
        for begin, end in _split_at_rests(kinds == 0)
        for first, last in _split_by_motion(kinds, begin, end)
    )


def build_move(recording: Recording, first: int, last: int) -> Move:
    """Return the move made by the ticks after row ``first`` up to row ``last``."""
    _, start_pose = find_place(recording, first)
    _, end_pose = find_place(recording, last)
    forward, sideways = to_relative_position(start_pose, end_pose.x, end_pose.y)
    return Move(
        first, last, forward, sideways, end_pose.heading - start_pose.heading, tick_to_seconds(recording, last - first)
    )


def compute_straight_mask(recording: Recording) -> NDArray[np.bool_]:
    """Return whether both wheels moved almost equally in each tick, shape (n,); false while the robot stands still."""
    forward_steps, turns = compute_travel(recording)
    between_wheels = np.radians(turns) * get_recorded_robot(recording).wheel_spacing
    return (np.abs(between_wheels) <= _STRAIGHT * np.abs(forward_steps)) & ~compute_still_mask(recording)


def _classify_ticks(recording: Recording) -> NDArray[np.int8]:
    """Return the kind of motion in each tick, shape (n,): forwards 1, backwards -1, left 2, right -2, rest 0."""
    forward_steps, turns = compute_travel(recording)
    kinds = np.where(compute_straight_mask(recording), np.sign(forward_steps), 2 * np.sign(turns))
    return np.where(compute_still_mask(recording), 0, kinds).astype(np.int8)


@dataclass(frozen=True, slots=True)
class Mismatch:
    """The difference between a move and the required one, as ``a turn of 85 to 95°, but it was 80°``."""

    description: str
    is_other_side: bool


@dataclass(frozen=True, slots=True)
class _Direction:
    """Templates for a measure of a move in one direction: the expected one, an actual one, and a part of a move."""

    expected: str
    actual: str
    part: str


@dataclass(frozen=True, slots=True)
class _Axis:
    """A measure of a move: the directions of its positive and negative values, and its unit."""

    positive: _Direction
    negative: _Direction
    unit: str
    has_sides: bool = False


_AMOUNT = "%(amount)s"
_FORWARDS, _BACKWARDS = translatable("%(amount)s forwards"), translatable("%(amount)s backwards")
_TO_LEFT, _TO_RIGHT = translatable("%(amount)s to the left"), translatable("%(amount)s to the right")
_DISTANCE = _Direction(
    translatable("a distance from where it began of %(range)s"),
    _AMOUNT,
    translatable("%(amount)s away from where it began"),
)
_TURN_SIZE = _Direction(translatable("a turn of %(range)s"), _AMOUNT, translatable("%(amount)s of turn"))
_DURATION = _Direction(translatable("a time of %(range)s"), _AMOUNT, translatable("%(amount)s long"))
#: By the names of the conditions, in the order in which they are checked.
_AXES: Mapping[str, _Axis] = MappingProxyType(
    {
        "distance": _Axis(_DISTANCE, _DISTANCE, " mm"),
        "forward": _Axis(
            _Direction(translatable("a distance forwards of %(range)s"), _FORWARDS, _FORWARDS),
            _Direction(translatable("a distance backwards of %(range)s"), _BACKWARDS, _BACKWARDS),
            " mm",
        ),
        "sideways": _Axis(
            _Direction(translatable("a distance to the left of %(range)s"), _TO_LEFT, _TO_LEFT),
            _Direction(translatable("a distance to the right of %(range)s"), _TO_RIGHT, _TO_RIGHT),
            " mm",
            has_sides=True,
        ),
        "turn": _Axis(
            _Direction(
                translatable("a turn to the left of %(range)s"),
                _TO_LEFT,
                translatable("%(amount)s of turn to the left"),
            ),
            _Direction(
                translatable("a turn to the right of %(range)s"),
                _TO_RIGHT,
                translatable("%(amount)s of turn to the right"),
            ),
            "°",
            has_sides=True,
        ),
        "turn_size": _Axis(_TURN_SIZE, _TURN_SIZE, "°"),
        "seconds": _Axis(_DURATION, _DURATION, " s"),
    }
)
#: The order in which the conditions of a required move are named.
_PARTS = ("forward", "sideways", "distance", "turn", "turn_size", "seconds")


def find_mismatch(required: MotionConditions, move: Move) -> Mismatch | None:
    """Return the first condition that a move does not meet; None if it meets all."""
    for name, axis in _AXES.items():
        bounds = getattr(required, name)
        value = abs(move.turn) if name == "turn_size" else getattr(move, name)
        if bounds is None or bounds[0] <= value <= bounds[1]:
            continue
        direction, minimum, maximum = _orient_range(axis, bounds)
        actual_direction = axis.negative if value < 0 else axis.positive
        number = format_number(abs(value))
        actual_template = actual_direction.actual if number != "0" else _AMOUNT
        description = Sentence(
            "%(expected)s, but it was %(actual)s",
            expected=Sentence(direction.expected, range=_describe_range(minimum, maximum, axis.unit)),
            actual=Sentence(actual_template, amount=f"{number}{axis.unit}"),
        )
        return Mismatch(description, axis.has_sides and number != "0" and direction is not actual_direction)
    return None


def count_missed_conditions(required: MotionConditions, move: Move) -> int:
    """Return how many of the conditions a move misses."""
    conditions = (name for name in _AXES if getattr(required, name) is not None)
    return sum(find_mismatch(NamedMotion(**{name: getattr(required, name)}), move) is not None for name in conditions)


def describe_required_move(required: NamedMotion) -> str:
    """Return the conditions as ``a move of 95 to 105 mm forwards, 1 s long``, after the move's name if it has one."""
    parts = []
    for name in _PARTS:
        bounds = getattr(required, name)
        if bounds is not None:
            direction, minimum, maximum = _orient_range(_AXES[name], bounds)
            parts.append(Sentence(direction.part, amount=_describe_range(minimum, maximum, _AXES[name].unit)))
    move = Sentence("a move of %(parts)s", parts=join_with_commas(parts))
    return Sentence("%(name)s: %(move)s", name=required.name, move=move) if required.name else move


def _orient_range(axis: _Axis, bounds: tuple[float, float]) -> tuple[_Direction, float, float]:
    """Return the direction of a range, with a negative range as a positive one."""
    minimum, maximum = bounds
    return (axis.negative, -maximum, -minimum) if maximum <= 0 and minimum < 0 else (axis.positive, minimum, maximum)


def _describe_range(minimum: float, maximum: float, unit: str) -> str:
    """Return a range as ``85 to 95°``, ``at least 100 mm`` or ``1 s``."""
    if maximum >= _NO_BOUND:
        return Sentence("at least %(amount)s", amount=f"{minimum:g}{unit}")
    if minimum == maximum:
        return f"{minimum:g}{unit}"
    return Sentence("%(least)s to %(most)s", least=f"{minimum:g}", most=f"{maximum:g}{unit}")


def format_number(value: float) -> str:
    """Return a number with at most two decimal places, without trailing zeros."""
    return f"{value:.2f}".rstrip("0").rstrip(".") if "." in f"{value:.2f}" else f"{value:.2f}"


def build_move_measures(move: Move, name: str) -> tuple[Measure, ...]:
    """Return the measures of a move, named ``move 2 forward`` and so on."""
    return (
        Measure(Sentence("%(move)s forward", move=name), move.forward, "mm"),
        Measure(Sentence("%(move)s sideways", move=name), move.sideways, "mm"),
        Measure(Sentence("%(move)s distance", move=name), move.distance, "mm"),
        Measure(Sentence("%(move)s turn", move=name), move.turn, "°"),
        Measure(Sentence("%(move)s seconds", move=name), move.seconds, "s"),
    )


def _split_at_rests(is_still: NDArray[np.bool_]) -> list[tuple[int, int]]:
    is_resting = np.zeros_like(is_still)
    for first, last in find_true_runs(is_still):
        if last - first > _REST or first == 0 or last == len(is_still):
            is_resting[first:last] = True
    return find_true_runs(~is_resting)


def _split_by_motion(kinds: NDArray[np.int8], first: int, last: int) -> list[tuple[int, int]]:
    """Split a range of ticks where two lasting kinds of motion meet."""
    lasting_runs = sorted(
        (begin, end, way)
        for way in (-2, -1, 1, 2)
        for begin, end in find_true_runs(kinds[first:last] == way)
        if end - begin >= _LASTING
    )
    cuts = [first]
    for (_, end, kind), (_, _, next_kind) in itertools.pairwise(lasting_runs):
        if kind != next_kind:
            cuts.append(first + end)
    return list(zip(cuts, [*cuts[1:], last], strict=True))
