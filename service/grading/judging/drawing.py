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

from service.grading.findings import OtherTurn
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
from service.language import translatable
from sim.recording import Floats, Recording
from sim.sentences import Sentence
from submissions.criteria.drawing import Drawing

#: Two straight parts whose directions differ by less than this may be one leg, degrees.
_SAME_DIRECTION_DEGREES = 3.0
#: Shorter straight parts belong to a corner, mm.
_MIN_LEG_MM = 20.0
#: A figure with legs that are longer by less than this, on average, is not larger than the one before, mm.
_MIN_GROWTH_MM = 1.0


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
    forward_steps, _ = compute_travel(recording)
    is_straight = compute_straight_mask(recording)
    is_drawn = compute_pen_mask(recording) if pen else np.ones(len(points), dtype=bool)
    is_straight &= is_drawn[:-1] & is_drawn[1:]
    parts = [
        _build_leg(points, first, last)
        for way in (1, -1)
        for first, last in find_true_runs(is_straight & (np.sign(forward_steps) == way))
    ]
    legs: list[Leg] = []
    for part in sorted(parts, key=lambda leg: leg.first):
        if part.length < _MIN_LEG_MM:
            continue
        if legs and _is_continuation(legs[-1], part) and is_drawn[legs[-1].last : part.first + 1].all():
            legs[-1] = _build_leg(points, legs[-1].first, part.last)
        else:
            legs.append(part)
    return tuple(legs)


def _is_continuation(leg: Leg, part: Leg) -> bool:
    """Return whether a part continues the leg: same direction, and on its line ahead of its end."""
    heading = math.radians(leg.direction)
    x, y = part.start[0] - leg.end[0], part.start[1] - leg.end[1]
    forward, sideways = x * math.cos(heading) + y * math.sin(heading), y * math.cos(heading) - x * math.sin(heading)
    is_same_direction = abs(compute_turn_angle(leg.direction, part.direction)) < _SAME_DIRECTION_DEGREES
    return is_same_direction and forward > -_MIN_LEG_MM and abs(sideways) < _MIN_LEG_MM


def compute_turn_angle(first_direction: float, second_direction: float) -> float:
    """Return the angle from one direction to another, degrees to the left, -180 to 180."""
    return (second_direction - first_direction + 180) % 360 - 180


@declare_judge(Drawing)
def judge_drawing(criterion: Drawing, trial: TrialResult) -> Outcome:
    """Judge each figure in order. The score is the fraction of correct figures."""
    recording = trial.recording
    if criterion.pen and not compute_pen_mask(recording).any():
        return fail_with(
            Sentence("Expected something to be drawn, but the pen was never down: the program's magic line has no -p."),
            0.0,
            recording.start,
        )
    legs = find_legs(recording, criterion.pen)
    leg_count = sum(criterion.legs_of_each)
    measures = _build_measures(legs)
    figures, remaining_count = _group_figures(criterion, legs)
    is_complete = (
        len(figures) >= criterion.figure_count and not remaining_count if criterion.at_least else len(legs) == leg_count
    )
    problems = [_find_problem(criterion, number, figure) for number, figure in enumerate(figures)]
    right_count = sum(problem is None for problem in problems[: criterion.figure_count])
    score = Fraction(right_count, criterion.figure_count)
    if not is_complete:
        lengths = ", ".join(f"{leg.length:.0f}" for leg in legs[:12])
        template = (
            translatable("Expected %(figures)s, but the path has %(count)s, of %(lengths)s mm.")
            if legs
            else translatable("Expected %(figures)s, but the path has none.")
        )
        row = legs[min(leg_count, len(legs)) - 1].last if legs else 0
        return fail_with(
            Sentence(template, figures=_describe_figures(criterion), count=len(legs), lengths=lengths),
            *find_place(recording, row),
            score=score / 2,
            measures=measures,
        )
    problem = next((problem for problem in problems if problem is not None), None)
    if problem is not None:
        moment = find_place(recording, problem.row)
        return fail_with(problem.message, *moment, score=score, measures=measures, findings=problem.findings)
    means = [_compute_mean_length(figure) for figure in figures]
    growths = [after - before for before, after in itertools.pairwise(means)]
    if criterion.growing and min(growths, default=_MIN_GROWTH_MM) < _MIN_GROWTH_MM:
        number = next(index for index, growth in enumerate(growths) if growth < _MIN_GROWTH_MM)
        return fail_with(
            Sentence(
                "Expected each figure to be larger than the one before, but after legs of %(before).0f mm came legs "
                "of %(after).0f mm.",
                before=means[number],
                after=means[number + 1],
            ),
            *find_place(recording, figures[number + 1][-1].last),
            measures=measures,
        )
    return pass_with(
        Sentence(
            "The path has %(count)s straight legs as expected, of %(lengths)s mm.",
            count=len(legs),
            lengths=", ".join(f"{mean:.0f}" for mean in means),
        ),
        *find_place(recording, legs[-1].last),
        measures,
    )


def _group_figures(criterion: Drawing, legs: Sequence[Leg]) -> tuple[list[Sequence[Leg]], int]:
    """Return the complete figures in order, and the number of remaining legs."""
    counts: Iterable[int] = criterion.legs if isinstance(criterion.legs, tuple) else itertools.repeat(criterion.legs)
    figures: list[Sequence[Leg]] = []
    start = 0
    for count in counts:
        if start + count > len(legs):
            break
        figures.append(legs[start : start + count])
        start += count
    return figures, len(legs) - start


@dataclass(frozen=True, slots=True)
class _Problem:
    """A problem with a figure, and the row where it appears."""

    message: str
    row: int
    findings: tuple[OtherTurn, ...] = ()


def _describe_figures(criterion: Drawing) -> str:
    if isinstance(criterion.legs, tuple):
        return Sentence(
            "figures of %(counts)s straight legs (%(total)s in all)",
            counts=quote_list(tuple(map(str, criterion.legs))),
            total=sum(criterion.legs),
        )
    legs = Sentence("%(count)s straight legs", count=criterion.legs)
    if criterion.legs == 1:
        legs = Sentence("%(count)s straight leg", count=1)
    if criterion.figure_count == 1:
        return Sentence("at least one figure of %(legs)s", legs=legs) if criterion.at_least else legs
    template = (
        translatable("at least %(count)s figures of %(legs)s (%(total)s in all)")
        if criterion.at_least
        else translatable("%(count)s figures of %(legs)s (%(total)s in all)")
    )
    count = criterion.figure_count
    return Sentence(template, count=count, legs=legs, total=count * criterion.legs)


def _describe_leg(criterion: Drawing, figure: int, leg: int) -> str:
    """Return ``leg 2``, or with several figures ``leg 2 of figure 1``, from the numbers of both."""
    if criterion.figure_count == 1:
        return Sentence("leg %(number)s", number=leg)
    return Sentence("leg %(number)s of figure %(figure)s", number=leg, figure=figure)


def _find_problem(criterion: Drawing, number: int, figure: Sequence[Leg]) -> _Problem | None:
    """Return the first problem with the figure, or None."""
    mean = _compute_mean_length(figure)
    for leg_number, leg in enumerate(figure, 1):
        if leg.length < criterion.shortest:
            return _Problem(
                Sentence(
                    "Expected each leg to be %(shortest)g mm or longer, but %(leg)s has %(length).0f mm.",
                    shortest=criterion.shortest,
                    leg=_describe_leg(criterion, number + 1, leg_number),
                    length=leg.length,
                ),
                leg.last,
            )
        if abs(leg.length - mean) > criterion.equal_within * mean:
            return _Problem(
                Sentence(
                    "Expected equal legs (within %(tolerance)s of their mean, %(mean).0f mm), but %(leg)s has "
                    "%(length).0f mm.",
                    tolerance=f"{criterion.equal_within:.0%}",
                    mean=mean,
                    leg=_describe_leg(criterion, number + 1, leg_number),
                    length=leg.length,
                ),
                leg.last,
            )
    for leg_number, (previous, following) in enumerate(itertools.pairwise(figure), 1):
        angle = abs(compute_turn_angle(previous.direction, following.direction))
        required_angle = criterion.angle_of_each[min(number, len(criterion.angle_of_each) - 1)]
        if abs(angle - required_angle) > criterion.angle_within:
            return _Problem(
                Sentence(
                    "Expected a turn of %(expected)g° (within %(tolerance)g°) after each leg, but after %(leg)s the "
                    "robot turned %(angle).1f°.",
                    expected=required_angle,
                    tolerance=criterion.angle_within,
                    leg=_describe_leg(criterion, number + 1, leg_number),
                    angle=angle,
                ),
                following.first,
                (OtherTurn(angle),),
            )
    if criterion.closes:
        gap = math.dist(figure[0].start, figure[-1].end)
        max_gap = max(criterion.closes_within, mean / 10)
        if gap > max_gap:
            template = (
                translatable(
                    "Expected the figure to end within %(limit).0f mm of where it began, but the end is %(gap).0f mm "
                    "away."
                )
                if criterion.figure_count == 1
                else translatable(
                    "Expected the figure to end within %(limit).0f mm of where it began, but the end of figure "
                    "%(number)s is %(gap).0f mm away."
                )
            )
            return _Problem(
                Sentence(template, limit=max_gap, gap=gap, number=number + 1),
                figure[-1].last,
            )
    if number < len(criterion.sizes):
        low, high = criterion.sizes[number]
        if not low <= mean <= high:
            return _Problem(
                Sentence(
                    "Expected legs of %(least)g to %(most)g mm in figure %(number)s, but they have %(mean).0f mm.",
                    least=low,
                    most=high,
                    number=number + 1,
                    mean=mean,
                ),
                figure[-1].last,
            )
    return None


def _compute_mean_length(figure: Sequence[Leg]) -> float:
    return sum(leg.length for leg in figure) / len(figure)


def _build_measures(legs: Sequence[Leg]) -> tuple[Measure, ...]:
    figures = [Measure(Sentence("legs"), len(legs))]
    figures += [
        Measure(Sentence("leg %(number)s", number=number), leg.length, "mm") for number, leg in enumerate(legs[:12], 1)
    ]
    figures += [
        Measure(
            Sentence("corner %(number)s", number=number),
            abs(compute_turn_angle(before.direction, after.direction)),
            "°",
        )
        for number, (before, after) in enumerate(itertools.pairwise(legs), 1)
    ]
    if legs:
        figures.append(Measure(Sentence("from start to end"), math.dist(legs[0].start, legs[-1].end), "mm"))
    return tuple(figures)


def _build_leg(points: Floats, first: int, last: int) -> Leg:
    """Return the leg from row ``first`` to row ``last``."""
    (x1, y1), (x2, y2) = points[first], points[last]
    return Leg(first, last, (float(x1), float(y1)), (float(x2), float(y2)))
