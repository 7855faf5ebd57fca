"""Judging of drawings: straight legs, the angles between them, and whether figures close.

A leg is a straight part of the path. A corner is the turn or bend between two legs.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from fractions import Fraction

import numpy as np

from service.grading.grade import Measure, TrialResult
from service.grading.judging.geometry import (
    compute_pen_mask,
    compute_positions,
    compute_travel,
    find_place,
    find_true_runs,
)
from service.grading.judging.judge_declaration import declare_judge
from service.grading.judging.message_parts import quote_list
from service.grading.judging.moves import compute_straight_mask
from service.grading.judging.outcome import Outcome, fail_with, pass_with
from sim.recording import Floats, Recording
from submissions.criteria.drawing import Drawing

#: Two straight parts whose directions differ by less than this may be one leg, degrees.
_SAME_DIRECTION_DEGREES = 3.0
#: Shorter straight parts belong to a corner, mm.
_MIN_LEG_MM = 20.0


@dataclass(frozen=True, slots=True)
class Leg:
    """A straight part of the path: its rows and its ends, mm."""

    first: int
    last: int
    start: tuple[float, float]
    end: tuple[float, float]

    @property
    def length(self) -> float:
        """The distance from end to end, mm."""
        return math.dist(self.start, self.end)

    @property
    def direction(self) -> float:
        """The direction of motion, degrees."""
        return math.degrees(math.atan2(self.end[1] - self.start[1], self.end[0] - self.start[0]))


def find_legs(recording: Recording, pen: bool) -> tuple[Leg, ...]:
    """Return the legs of a path in order. With ``pen``, only drawn ones."""
    points = compute_positions(recording)
    ahead, _ = compute_travel(recording)
    going = compute_straight_mask(recording)
    drawn = compute_pen_mask(recording) if pen else np.ones(len(points), dtype=bool)
    going &= drawn[:-1] & drawn[1:]
    parts = [
        _build_leg(points, first, last)
        for way in (1, -1)
        for first, last in find_true_runs(going & (np.sign(ahead) == way))
    ]
    legs: list[Leg] = []
    for part in sorted(parts, key=lambda leg: leg.first):
        if part.length < _MIN_LEG_MM:
            continue
        if legs and _is_continuation(legs[-1], part) and drawn[legs[-1].last : part.first + 1].all():
            legs[-1] = _build_leg(points, legs[-1].first, part.last)
        else:
            legs.append(part)
    return tuple(legs)


def _is_continuation(leg: Leg, part: Leg) -> bool:
    """Return whether a part continues the leg: same direction, and on its line ahead of its end."""
    along = math.radians(leg.direction)
    x, y = part.start[0] - leg.end[0], part.start[1] - leg.end[1]
    ahead, aside = x * math.cos(along) + y * math.sin(along), y * math.cos(along) - x * math.sin(along)
    same_direction = abs(compute_turn_angle(leg.direction, part.direction)) < _SAME_DIRECTION_DEGREES
    return same_direction and ahead > -_MIN_LEG_MM and abs(aside) < _MIN_LEG_MM


def compute_turn_angle(before: float, after: float) -> float:
    """Return the angle from one direction to another, degrees to the left, -180 to 180."""
    return (after - before + 180) % 360 - 180


@declare_judge(Drawing)
def judge_drawing(criterion: Drawing, trial: TrialResult) -> Outcome:
    """Judge each figure in order. The score is the fraction of correct figures."""
    recording = trial.recording
    if criterion.pen and not compute_pen_mask(recording).any():
        return fail_with(
            "Expected something to be drawn, but the pen was never down: the program's magic line has no -p.",
            0.0,
            recording.start,
        )
    legs = find_legs(recording, criterion.pen)
    wanted = sum(criterion.legs_of_each)
    measures = _build_measures(legs)
    figures, left_over = _group_figures(criterion, legs)
    enough = len(figures) >= criterion.figure_count and not left_over if criterion.at_least else len(legs) == wanted
    problems = [_find_problem(criterion, number, figure) for number, figure in enumerate(figures)]
    right = sum(problem is None for problem in problems[: criterion.figure_count])
    score = Fraction(right, criterion.figure_count)
    if not enough:
        lengths = ", ".join(f"{leg.length:.0f}" for leg in legs[:12])
        told = f"{len(legs)}, of {lengths} mm" if legs else "none"
        row = legs[min(wanted, len(legs)) - 1].last if legs else 0
        return fail_with(
            f"Expected {_describe_figures(criterion)}, but the path has {told}.",
            *find_place(recording, row),
            score=score / 2,
            measures=measures,
        )
    found = next((problem for problem in problems if problem is not None), None)
    if found is not None:
        return fail_with(found.words, *find_place(recording, found.row), score=score, measures=measures)
    means = [_compute_mean_length(figure) for figure in figures]
    if criterion.growing and any(after <= before for before, after in itertools.pairwise(means)):
        number = next(n for n, (before, after) in enumerate(itertools.pairwise(means)) if after <= before)
        return fail_with(
            f"Expected each figure to be larger than the one before, but after legs of {means[number]:.0f} mm came "
            f"legs of {means[number + 1]:.0f} mm.",
            *find_place(recording, figures[number + 1][-1].last),
            measures=measures,
        )
    told = ", ".join(f"{mean:.0f}" for mean in means)
    return pass_with(
        f"The path has {len(legs)} straight legs as expected, of {told} mm.",
        *find_place(recording, legs[-1].last),
        measures,
    )


def _group_figures(criterion: Drawing, legs: Sequence[Leg]) -> tuple[list[Sequence[Leg]], int]:
    """Return the complete figures in order, and the number of remaining legs."""
    counts: Iterable[int] = criterion.legs if isinstance(criterion.legs, tuple) else itertools.repeat(criterion.legs)
    figures: list[Sequence[Leg]] = []
    first = 0
    for count in counts:
        if first + count > len(legs):
            break
        figures.append(legs[first : first + count])
        first += count
    return figures, len(legs) - first


@dataclass(frozen=True, slots=True)
class _Problem:
    """A problem with a figure, and the row where it appears."""

    words: str
    row: int


def _describe_figures(criterion: Drawing) -> str:
    if isinstance(criterion.legs, tuple):
        return f"figures of {quote_list(tuple(map(str, criterion.legs)))} straight legs ({sum(criterion.legs)} in all)"
    legs = f"{criterion.legs} straight leg{'' if criterion.legs == 1 else 's'}"
    least = "at least " if criterion.at_least else ""
    if criterion.figure_count == 1:
        return f"{least}one figure of {legs}" if least else legs
    return f"{least}{criterion.figure_count} figures of {legs} ({criterion.figure_count * criterion.legs} in all)"


def _find_problem(criterion: Drawing, number: int, figure: Sequence[Leg]) -> _Problem | None:
    """Return the first problem with the figure, or None."""
    mean = _compute_mean_length(figure)
    which = f" of figure {number + 1}" if criterion.figure_count > 1 else ""
    for place, leg in enumerate(figure, 1):
        if leg.length < criterion.shortest:
            return _Problem(
                f"Expected each leg to be {criterion.shortest:g} mm or longer, but leg {place}{which} has "
                f"{leg.length:.0f} mm.",
                leg.last,
            )
        if abs(leg.length - mean) > criterion.equal_within * mean:
            return _Problem(
                f"Expected equal legs (within {criterion.equal_within:.0%} of their mean, {mean:.0f} mm), "
                f"but leg {place}{which} has {leg.length:.0f} mm.",
                leg.last,
            )
    for place, (before, after) in enumerate(itertools.pairwise(figure), 1):
        angle = abs(compute_turn_angle(before.direction, after.direction))
        asked = criterion.angle_of_each[min(number, len(criterion.angle_of_each) - 1)]
        if abs(angle - asked) > criterion.angle_within:
            return _Problem(
                f"Expected a turn of {asked:g}° (within {criterion.angle_within:g}°) after each leg, "
                f"but after leg {place}{which} the robot turned {angle:.1f}°.",
                after.first,
            )
    if criterion.closes:
        gap = math.dist(figure[0].start, figure[-1].end)
        allowed = max(criterion.closes_within, mean / 10)
        if gap > allowed:
            return _Problem(
                f"Expected the figure to end within {allowed:.0f} mm of where it began, "
                f"but the end{which} is {gap:.0f} mm away.",
                figure[-1].last,
            )
    if number < len(criterion.sizes):
        low, high = criterion.sizes[number]
        if not low <= mean <= high:
            return _Problem(
                f"Expected legs of {low:g} to {high:g} mm in figure {number + 1}, but they have {mean:.0f} mm.",
                figure[-1].last,
            )
    return None


def _compute_mean_length(figure: Sequence[Leg]) -> float:
    return sum(leg.length for leg in figure) / len(figure)


def _build_measures(legs: Sequence[Leg]) -> tuple[Measure, ...]:
    figures = [Measure("legs", len(legs))]
    figures += [Measure(f"leg {number}", leg.length, "mm") for number, leg in enumerate(legs[:12], 1)]
    figures += [
        Measure(f"corner {number}", abs(compute_turn_angle(before.direction, after.direction)), "°")
        for number, (before, after) in enumerate(itertools.pairwise(legs), 1)
    ]
    if legs:
        figures.append(Measure("from start to end", math.dist(legs[0].start, legs[-1].end), "mm"))
    return tuple(figures)


def _build_leg(points: Floats, first: int, last: int) -> Leg:
    """Return the leg from row ``first`` to row ``last``."""
    (x1, y1), (x2, y2) = points[first], points[last]
    return Leg(first, last, (float(x1), float(y1)), (float(x2), float(y2)))
