"""Judging of the path: through places, within areas, outside areas, and without touching obstacles.

``point.py`` judges paths round a point, and ``line.py`` line following.
"""

from __future__ import annotations

from fractions import Fraction

import numpy as np

from service.grading.grade import Measure, TrialResult
from service.grading.judging.geometry import (
    compute_positions,
    compute_still_mask,
    find_place,
    find_true_runs,
    measure_area_distance,
)
from service.grading.judging.judge_declaration import declare_judge
from service.grading.judging.matching import match_maximum_in_order
from service.grading.judging.outcome import Outcome, fail_with, pass_with
from sim.recording import Floats, Recording
from submissions.criteria.path import KeepsOut, StaysInside, TouchesNothing, Visits
from submissions.criteria.places import Area, Part

#: Standing still for more than this many ticks (half a second), or at the end, counts as a stop.
_STOP = 15
#: The smallest change of heading that counts as a turn, degrees.
_TURN = 2.0
#: Longer than any straight path on the floor, mm.
_RAY_LENGTH = 10_000.0

PART_NAMES = {
    "robot": "the robot",
    "pen": "the pen",
    "left_light": "the left light sensor",
    "right_light": "the right light sensor",
}


@declare_judge(Visits)
def judge_visits(criterion: Visits, trial: TrialResult) -> Outcome:
    """Judge the places in order (or at any time). A place is visited when its edge is reached."""
    recording = trial.recording
    points = compute_positions(recording, criterion.of)
    visited_rows = _find_visited_rows(criterion, points)
    rows = [row for row in visited_rows if row is not None]
    missed_area = next((place for place, row in zip(criterion.places, visited_rows, strict=True) if row is None), None)
    visited_count = len(rows)
    measures = (Measure("places visited", visited_count),)
    required_count = criterion.at_least or len(criterion.places)
    score = Fraction(min(visited_count, required_count), required_count)
    part_name = PART_NAMES[criterion.of]
    if missed_area is not None and visited_count < required_count:
        nearest = _find_nearest(measure_area_distance(missed_area, points))
        order_clause = (
            ", after the places before it," if criterion.in_order and criterion.places[0] is not missed_area else ""
        )
        behaviour = (
            f"its smallest distance was {nearest[1]:.0f} mm" if nearest and nearest[1] > 0 else "it did not get there"
        )
        return fail_with(
            f"Expected {part_name} to reach{order_clause} {missed_area}, but {behaviour} "
            f"({visited_count} of {len(criterion.places)} places visited).",
            *find_place(recording, nearest[0] if nearest else len(points) - 1),
            score=score,
            measures=measures,
        )
    stops = [(place, row) for place in criterion.places if (row := _find_stop(recording, place, points)) is not None]
    if criterion.without_stopping and stops:
        stop_area, row = stops[0]
        return fail_with(
            f"Expected {part_name} not to stop in {stop_area}, but it stopped there.",
            *find_place(recording, row),
            score=Fraction(max(min(visited_count, required_count) - len(stops), 0), required_count),
            measures=measures,
        )
    places = (
        str(criterion.places[0]) if len(criterion.places) == 1 else f"{visited_count} of {len(criterion.places)} places"
    )
    return pass_with(f"{_capitalise(part_name)} reached {places}.", *find_place(recording, max(rows)), measures)


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
    part_name, area_text = PART_NAMES[criterion.of], _describe_areas(criterion.areas)
    measures = (
        *_measure_bounds(points),
        Measure("farthest out", float(np.nanmax(depth)), "mm"),
    )
    outside_rows = np.flatnonzero(~(depth <= 0) & ~np.isnan(points[:, 0]))
    if len(outside_rows):
        row = int(outside_rows[0])
        share = Fraction(row, len(points))
        return fail_with(
            f"Expected {part_name} to stay in {area_text}, but it left it at ({points[row, 0]:.0f}, "
            f"{points[row, 1]:.0f}) and was up to {np.nanmax(depth):.0f} mm outside.",
            *find_place(recording, row),
            score=share,
            measures=measures,
        )
    if _measure_driven_distance(recording) < criterion.drives:
        return _fail_for_short_drive(recording, criterion.drives, measures)
    return pass_with(f"{_capitalise(part_name)} stayed in {area_text}.", recording.end_t, recording.end, measures)


@declare_judge(KeepsOut)
def judge_keeps_out(criterion: KeepsOut, trial: TrialResult) -> Outcome:
    """Judge by the least distance to any of the areas."""
    recording = trial.recording
    points = _find_positions(recording, criterion.of)
    if points is None:
        return _fail_for_missing_pen(recording)
    part_name = PART_NAMES[criterion.of]
    distances = np.array([measure_area_distance(area, points) for area in criterion.areas])
    measures = (Measure("least clearance", float(np.nanmin(distances)), "mm"), *_measure_bounds(points))
    is_too_near = (distances <= 0) | (distances < criterion.clear_of)
    if is_too_near.any():
        row = int(np.flatnonzero(is_too_near.any(axis=0))[0])
        number = int(np.flatnonzero(is_too_near[:, row])[0])
        min_distance = float(np.nanmin(distances[number]))
        requirement = f"keep {criterion.clear_of:g} mm from" if criterion.clear_of else "stay out of"
        position_text = f"at ({points[row, 0]:.0f}, {points[row, 1]:.0f})"
        behaviour = f"it entered it {position_text}"
        if criterion.clear_of:
            behaviour = f"it came too near {position_text}; its smallest distance was {max(min_distance, 0):.0f} mm"
        return fail_with(
            f"Expected {part_name} to {requirement} {criterion.areas[number]}, but {behaviour}.",
            *find_place(recording, row),
            measures=measures,
        )
    if _measure_driven_distance(recording) < criterion.drives:
        return _fail_for_short_drive(recording, criterion.drives, measures)
    return pass_with(
        f"{_capitalise(part_name)} stayed out of {'them all' if len(criterion.areas) > 1 else criterion.areas[0]}, "
        f"by {np.nanmin(distances):.0f} mm or more.",
        recording.end_t,
        recording.end,
        measures,
    )


@declare_judge(TouchesNothing)
def judge_touches_nothing(criterion: TouchesNothing, trial: TrialResult) -> Outcome:
    """Judge what the body touched. It fails at the first touch beyond the allowed number."""
    recording = trial.recording
    touches = recording.touches
    measures = (Measure("touches", len(touches)),)
    if len(touches) > criterion.at_most:
        touch = touches[criterion.at_most]
        limit_text = f"at most {criterion.at_most} times" if criterion.at_most else "nothing"
        return fail_with(
            f"Expected the robot to touch {limit_text}, but it touched {touch.what}.",
            touch.t,
            touch.pose,
            measures=measures,
        )
    return pass_with("The robot touched nothing." if not touches else f"The robot touched {len(touches)} times.",
                  recording.end_t, recording.end, measures)  # fmt: skip


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
        f"Expected the robot to drive {min_distance:g} mm or more, but it drove only "
        f"{_measure_driven_distance(recording):.0f} mm.",
        recording.end_t,
        recording.end,
        score=Fraction(min(_measure_driven_distance(recording) / min_distance, 1.0)).limit_denominator(1000),
        measures=measures,
    )


def _fail_for_missing_pen(recording: Recording) -> Outcome:
    return fail_with(
        "Expected the pen to be down, but the program's magic line has no -p, so nothing was drawn.",
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
    figures = (("least x", left), ("greatest x", right), ("least y", bottom), ("greatest y", top))
    return tuple(Measure(name, float(value), "mm") for name, value in figures)


def _describe_areas(areas: tuple[Area, ...]) -> str:
    return str(areas[0]) if len(areas) == 1 else f"one of {len(areas)} areas"


def _capitalise(text: str) -> str:
    return text[:1].upper() + text[1:]
