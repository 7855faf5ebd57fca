"""Division of a run into moves, with the measures of each.

This module only finds and measures moves. ``motion.py`` judges them.
"""

from __future__ import annotations

import itertools
import math
from dataclasses import dataclass

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
from sim.recording import Recording
from sim.recording_values import get_recorded_robot, tick_to_seconds
from submissions.criteria.motion import MotionConditions

#: A smaller relative difference between the wheels counts as straight.
_STRAIGHT = 0.1
#: Two kinds of motion are separate moves if each lasts at least this many ticks (0.3 s).
_LASTING = 9
#: A bound this large (mm, degrees, s) means no bound, because no run reaches it.
_NO_BOUND = 10_000
#: A rest of at most this many ticks does not split a move.
_REST = 2
_LEFT = " to the left"


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

    def __str__(self) -> str:
        clauses = []
        if abs(self.turn) >= 2:
            clauses.append(f"turned {abs(self.turn):.1f}° {'left' if self.turn > 0 else 'right'}")
        if self.distance >= 5 or not clauses:
            direction = "forwards" if self.forward >= 0 else "backwards"
            clauses.append(f"went {abs(self.forward):.0f} mm {direction}")
        if abs(self.sideways) >= 5:
            clauses.append(f"{abs(self.sideways):.0f} mm to its {'left' if self.sideways > 0 else 'right'}")
        return f"{' and '.join(clauses)} in {self.seconds:.2f} s"


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

    words: str
    is_other_side: bool


def find_mismatch(required: MotionConditions, move: Move) -> Mismatch | None:
    """Return the first condition that a move does not meet; None if it meets all."""
    conditions = (
        ("a distance from where it began", "", "", required.distance, move.distance, " mm"),
        ("a distance", " forwards", " backwards", required.forward, move.forward, " mm"),
        ("a distance", _LEFT, " to the right", required.sideways, move.sideways, " mm"),
        ("a turn", _LEFT, " to the right", required.turn, move.turn, "°"),
        ("a turn", "", "", required.turn_size, abs(move.turn), "°"),
        ("a time", "", "", required.seconds, move.seconds, " s"),
    )
    for noun, positive, negative, bounds, value, unit in conditions:
        if bounds is None or bounds[0] <= value <= bounds[1]:
            continue
        side, minimum, maximum = orient_range(bounds, positive, negative)
        actual = format_number(abs(value))
        direction = "" if actual == "0" else negative if value < 0 else positive
        words = f"{noun}{side} of {describe_range(minimum, maximum, unit)}, but it was {actual}{unit}{direction}"
        return Mismatch(words, positive == _LEFT and bool(direction) and side != direction)
    return None


def orient_range(bounds: tuple[float, float], positive: str, negative: str) -> tuple[str, float, float]:
    """Return a negative range as a positive one, with the word for its side."""
    minimum, maximum = bounds
    return (negative, -maximum, -minimum) if maximum <= 0 and minimum < 0 else (positive, minimum, maximum)


def describe_range(minimum: float, maximum: float, unit: str) -> str:
    """Return a range as ``85 to 95°``, ``at least 100 mm`` or ``1 s``."""
    if maximum >= _NO_BOUND:
        return f"at least {minimum:g}{unit}"
    return f"{minimum:g}{unit}" if minimum == maximum else f"{minimum:g} to {maximum:g}{unit}"


def format_number(value: float) -> str:
    """Return a number with at most two decimal places, without trailing zeros."""
    return f"{value:.2f}".rstrip("0").rstrip(".") if "." in f"{value:.2f}" else f"{value:.2f}"


def build_move_measures(move: Move, name: str) -> tuple[Measure, ...]:
    """Return the measures of a move, named ``move 2 forward`` and so on."""
    return (
        Measure(f"{name} forward", move.forward, "mm"),
        Measure(f"{name} sideways", move.sideways, "mm"),
        Measure(f"{name} distance", move.distance, "mm"),
        Measure(f"{name} turn", move.turn, "°"),
        Measure(f"{name} seconds", move.seconds, "s"),
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
