"""Judging of the path: through places, within areas, outside areas, and without touching obstacles.

``point.py`` judges paths round a point, and ``line.py`` line following.
"""

from __future__ import annotations

from collections.abc import Mapping
from fractions import Fraction
from types import MappingProxyType

import numpy as np

from service.grading.grade import Measure, TrialResult
from service.grading.judging.geometry import (
    compute_positions,
    compute_still_mask,
    describe_area,
    find_place,
    find_true_runs,
    measure_area_distance,
)
from service.grading.judging.judge_declaration import declare_judge
from service.grading.judging.matching import match_maximum_in_order
from service.grading.judging.outcome import Outcome, fail_with, pass_with
from service.language import translatable
from sim.recording import Floats, Recording
from sim.sentences import Sentence
from submissions.criteria.path import KeepsOut, StaysInside, TouchesNothing, Visits
from submissions.criteria.places import Area, Part

#: Standing still for more than this many ticks (half a second), or at the end, counts as a stop.
_STOP = 15
#: The smallest change of heading that counts as a turn, degrees.
_TURN = 2.0
#: Longer than any straight path on the floor, mm.
_RAY_LENGTH = 10_000.0

_PARTS: Mapping[Part, str] = MappingProxyType(
    {
        "robot": translatable("the robot"),
        "pen": translatable("the pen"),
        "left_light": translatable("the left light sensor"),
        "right_light": translatable("the right light sensor"),
    }
)
#: At the beginning of a sentence.
_CAPITALISED_PARTS: Mapping[Part, str] = MappingProxyType(
    {
        "robot": translatable("The robot"),
        "pen": translatable("The pen"),
        "left_light": translatable("The left light sensor"),
        "right_light": translatable("The right light sensor"),
    }
)
_WALLS: Mapping[str, str] = MappingProxyType(
    {
        "left wall": translatable("left wall"),
        "right wall": translatable("right wall"),
        "bottom wall": translatable("bottom wall"),
        "top wall": translatable("top wall"),
    }
)


def describe_part(part: Part, *, capitalised: bool = False) -> str:
    """Return the name of a part for a sentence, for its beginning with ``capitalised``."""
    return Sentence((_CAPITALISED_PARTS if capitalised else _PARTS)[part])


@declare_judge(Visits)
def judge_visits(criterion: Visits, trial: TrialResult) -> Outcome:
    """Judge the places in order (or at any time). A place is visited when its edge is reached."""
    recording = trial.recording
    points = compute_positions(recording, criterion.of)
    visited_rows = _find_visited_rows(criterion, points)
    rows = [row for row in visited_rows if row is not None]
    missed_area = next((place for place, row in zip(criterion.places, visited_rows, strict=True) if row is None), None)
    visited_count = len(rows)
    measures = (Measure(Sentence("places visited"), visited_count),)
    required_count = criterion.at_least or len(criterion.places)
    score = Fraction(min(visited_count, required_count), required_count)
    part_name = describe_part(criterion.of)
    if missed_area is not None and visited_count < required_count:
        nearest = _find_nearest(measure_area_distance(missed_area, points))
        template = translatable("Expected %(part)s to reach %(area)s")
        if criterion.in_order and criterion.places[0] is not missed_area:
            template = translatable("Expected %(part)s to reach, after the places before it, %(area)s")
        expectation = Sentence(template, part=part_name, area=describe_area(missed_area))
        template = translatable("%(expectation)s, but it did not get there (%(visited)s of %(count)s places visited).")
        if nearest and nearest[1] > 0:
            template = translatable(
                "%(expectation)s, but its smallest distance was %(distance).0f mm (%(visited)s of %(count)s places "
                "visited)."
            )
        return fail_with(
            Sentence(
                template,
                expectation=expectation,
                distance=nearest[1] if nearest else 0,
                visited=visited_count,
                count=len(criterion.places),
            ),
            *find_place(recording, nearest[0] if nearest else len(points) - 1),
            score=score,
            measures=measures,
        )
    stops = [(place, row) for place in criterion.places if (row := _find_stop(recording, place, points)) is not None]
    if criterion.without_stopping and stops:
        stop_area, row = stops[0]
        return fail_with(
            Sentence(
                "Expected %(part)s not to stop in %(area)s, but it stopped there.",
                part=part_name,
                area=describe_area(stop_area),
            ),
            *find_place(recording, row),
            score=Fraction(max(min(visited_count, required_count) - len(stops), 0), required_count),
            measures=measures,
        )
    message = Sentence(
        "%(part)s reached %(visited)s of %(count)s places.",
        part=describe_part(criterion.of, capitalised=True),
        visited=visited_count,
        count=len(criterion.places),
    )
    if len(criterion.places) == 1:
        message = Sentence(
            "%(part)s reached %(area)s.",
            part=describe_part(criterion.of, capitalised=True),
            area=describe_area(criterion.places[0]),
        )
    return pass_with(message, *find_place(recording, max(rows)), measures)


def _find_visited_rows(criterion: Visits, points: Floats) -> list[int | None]:
    """Return the row at which each place is visited, None if it is not; with ``in_order`` as many as possible."""
    inside_rows = [np.flatnonzero(measure_area_distance(place, points) <= 0) for place in criterion.places]

    def find_next_row(index: int, row: int) -> int | None:
        number = int(np.searchsorted(inside_rows[index], row))
        return int(inside_rows[index][number]) if number < len(inside_rows[index]) else None

    if criterion.in_order:
        # Places may overlap, so one row may be in several.
        return match_maximum_in_order(len(inside_rows), find_next_row, step=0)
    return [find_next_row(place, 0) for place in range(len(inside_rows))]


@declare_judge(StaysInside)
def judge_stays_inside(criterion: StaysInside, trial: TrialResult) -> Outcome:
    """Judge by the first position outside all areas. The score is the fraction of the path before it."""
    recording = trial.recording
    points = _find_positions(recording, criterion.of)
    if points is None:
        return _fail_for_missing_pen(recording)
    depth = np.min([measure_area_distance(area, points) for area in criterion.areas], axis=0)
    area_text = _describe_areas(criterion.areas)
    measures = (
        *_measure_bounds(points),
        Measure(Sentence("farthest out"), float(np.nanmax(depth)), "mm"),
    )
    outside_rows = np.flatnonzero(~(depth <= 0) & ~np.isnan(points[:, 0]))
    if len(outside_rows):
        row = int(outside_rows[0])
        share = Fraction(row, len(points))
        return fail_with(
            Sentence(
                "Expected %(part)s to stay in %(area)s, but it left it at (%(x).0f, %(y).0f) and was up to "
                "%(distance).0f mm outside.",
                part=describe_part(criterion.of),
                area=area_text,
                x=float(points[row, 0]),
                y=float(points[row, 1]),
                distance=float(np.nanmax(depth)),
            ),
            *find_place(recording, row),
            score=share,
            measures=measures,
        )
    if _measure_driven_distance(recording) < criterion.drives:
        return _fail_for_short_drive(recording, criterion.drives, measures)
    message = Sentence(
        "%(part)s stayed in %(area)s.", part=describe_part(criterion.of, capitalised=True), area=area_text
    )
    return pass_with(message, recording.end_t, recording.end, measures)


@declare_judge(KeepsOut)
def judge_keeps_out(criterion: KeepsOut, trial: TrialResult) -> Outcome:
    """Judge by the least distance to any of the areas."""
    recording = trial.recording
    points = _find_positions(recording, criterion.of)
    if points is None:
        return _fail_for_missing_pen(recording)
    distances = np.array([measure_area_distance(area, points) for area in criterion.areas])
    measures = (Measure(Sentence("least clearance"), float(np.nanmin(distances)), "mm"), *_measure_bounds(points))
    is_too_near = (distances <= 0) | (distances < criterion.clear_of)
    if is_too_near.any():
        row = int(np.flatnonzero(is_too_near.any(axis=0))[0])
        number = int(np.flatnonzero(is_too_near[:, row])[0])
        min_distance = float(np.nanmin(distances[number]))
        template = (
            translatable(
                "Expected %(part)s to keep %(clearance)g mm from %(area)s, but it came too near at (%(x).0f, %(y).0f); "
                "its smallest distance was %(distance).0f mm."
            )
            if criterion.clear_of
            else translatable("Expected %(part)s to stay out of %(area)s, but it entered it at (%(x).0f, %(y).0f).")
        )
        return fail_with(
            Sentence(
                template,
                part=describe_part(criterion.of),
                clearance=criterion.clear_of,
                area=describe_area(criterion.areas[number]),
                x=float(points[row, 0]),
                y=float(points[row, 1]),
                distance=max(min_distance, 0),
            ),
            *find_place(recording, row),
            measures=measures,
        )
    if _measure_driven_distance(recording) < criterion.drives:
        return _fail_for_short_drive(recording, criterion.drives, measures)
    template = (
        translatable("%(part)s stayed out of %(area)s, by %(distance).0f mm or more.")
        if len(criterion.areas) == 1
        else translatable("%(part)s stayed out of them all, by %(distance).0f mm or more.")
    )
    message = Sentence(
        template,
        part=describe_part(criterion.of, capitalised=True),
        area=describe_area(criterion.areas[0]),
        distance=float(np.nanmin(distances)),
    )
    return pass_with(message, recording.end_t, recording.end, measures)


@declare_judge(TouchesNothing)
def judge_touches_nothing(criterion: TouchesNothing, trial: TrialResult) -> Outcome:
    """Judge what the body touched. It fails at the first touch beyond the allowed number."""
    recording = trial.recording
    touches = recording.touches
    measures = (Measure(Sentence("touches"), len(touches)),)
    if len(touches) > criterion.at_most:
        touch = touches[criterion.at_most]
        template = (
            translatable("Expected the robot to touch at most %(limit)s times, but it touched %(thing)s.")
            if criterion.at_most
            else translatable("Expected the robot to touch nothing, but it touched %(thing)s.")
        )
        thing = Sentence(_WALLS[touch.what]) if touch.what in _WALLS else touch.what
        return fail_with(
            Sentence(template, limit=criterion.at_most, thing=thing),
            touch.t,
            touch.pose,
            measures=measures,
        )
    message = Sentence("The robot touched nothing.")
    if touches:
        message = Sentence("The robot touched %(count)s times.", count=len(touches))
    return pass_with(message, recording.end_t, recording.end, measures)


def _find_stop(recording: Recording, area: Area, points: Floats) -> int | None:
    """Return the row at which the robot had stopped in a place, or None."""
    is_inside = measure_area_distance(area, points)[1:] <= 0
    is_resting = compute_still_mask(recording) & is_inside
    for first, last in find_true_runs(is_resting):
        if last - first > _STOP:
            return first + 1
    return len(points) - 1 if len(is_inside) and is_inside[-1] else None


def _find_positions(recording: Recording, part: Part) -> Floats | None:
    """Return the part's positions; None if the pen never drew."""
    points = compute_positions(recording, part)
    return None if np.isnan(points).all() else points


def _measure_driven_distance(recording: Recording) -> float:
    """Return the total distance driven, mm."""
    return float(np.hypot(*np.diff(compute_positions(recording), axis=0).T).sum())


def _fail_for_short_drive(recording: Recording, min_distance: float, measures: tuple[Measure, ...]) -> Outcome:
    return fail_with(
        Sentence(
            "Expected the robot to drive %(least)g mm or more, but it drove only %(distance).0f mm.",
            least=min_distance,
            distance=_measure_driven_distance(recording),
        ),
        recording.end_t,
        recording.end,
        score=Fraction(min(_measure_driven_distance(recording) / min_distance, 1.0)).limit_denominator(1000),
        measures=measures,
    )


def _fail_for_missing_pen(recording: Recording) -> Outcome:
    return fail_with(
        Sentence("Expected the pen to be down, but the program's magic line has no -p, so nothing was drawn."),
        0.0,
        recording.start,
    )


def _find_nearest(distances: Floats) -> tuple[int, float] | None:
    if np.isnan(distances).all():
        return None
    row = int(np.nanargmin(distances))
    return row, float(distances[row])


def _measure_bounds(points: Floats) -> tuple[Measure, ...]:
    """Return the bounding rectangle of the path."""
    (left, bottom), (right, top) = np.nanmin(points, axis=0), np.nanmax(points, axis=0)
    bounds = (
        (translatable("least x"), left),
        (translatable("greatest x"), right),
        (translatable("least y"), bottom),
        (translatable("greatest y"), top),
    )
    return tuple(Measure(Sentence(name), float(value), "mm") for name, value in bounds)


def _describe_areas(areas: tuple[Area, ...]) -> str:
    return describe_area(areas[0]) if len(areas) == 1 else Sentence("one of %(count)s areas", count=len(areas))
