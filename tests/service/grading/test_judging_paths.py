"""Judging where the robot went: places, areas, lines, laps and circuits, with runs and geometry made by hand."""

from __future__ import annotations

import itertools
import math
from typing import Any

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st
from pydantic import ValidationError

from driving import along, driven, measured, passes, rest, spin, straight
from judging import criterion, judged
from service.grading.judging.geometry import (
    LineProgress,
    compute_positions,
    measure_area_distance,
    measure_covered_share,
)
from service.grading.judging.geometry import track_line_progress as along_line
from service.grading.judging.line import Crossing, find_complete_laps
from service.grading.judging.point import compute_rounds
from sim.floors.tracks import load_centrelines
from sim.recording import Pose, Touch
from submissions.criteria.line import Laps
from submissions.criteria.places import Area, LineToFollow

pytestmark = pytest.mark.fast

coordinates = st.floats(-500, 500, allow_nan=False).map(lambda value: round(value, 3))
points = st.tuples(coordinates, coordinates)


@given(points, st.floats(1, 300))
@settings(deadline=None)
def test_a_bar_without_length_is_a_circle(point: tuple[float, float], radius: float) -> None:
    circle, bar = Area(circle=(3, 4, radius)), Area(bar=(3, 4, 3, 4, radius))
    assert measure_area_distance(circle, np.array([point])) == pytest.approx(
        measure_area_distance(bar, np.array([point]))
    )


@given(points)
@settings(deadline=None)
def test_a_rectangle_is_a_polygon_whichever_way_round(point: tuple[float, float]) -> None:
    rectangle = Area(rectangle=(-100, -50, 200, 80))
    corners = ((-100, -50), (200, -50), (200, 80), (-100, 80))
    position = np.array([point])
    for turned in (corners, corners[::-1], corners[2:] + corners[:2]):
        assert measure_area_distance(Area(polygon=turned), position) == pytest.approx(
            measure_area_distance(rectangle, position)
        )
    inside = -100 < point[0] < 200 and -50 < point[1] < 80
    assert (measure_area_distance(rectangle, position)[0] < 0) == inside


@given(points, st.floats(0, 2 * math.pi))
@settings(deadline=None)
def test_distance_is_how_far_one_must_go_to_the_edge(point: tuple[float, float], direction: float) -> None:
    shape = Area(polygon=((0, 0), (300, 40), (250, 260), (120, 90), (-60, 200)))
    distance = float(measure_area_distance(shape, np.array([point]))[0])
    step = abs(distance) * 0.999
    moved = np.array([[point[0] + step * math.cos(direction), point[1] + step * math.sin(direction)]])
    assert float(measure_area_distance(shape, moved)[0]) * distance >= 0


@pytest.mark.parametrize(
    "table",
    [
        {},
        {"circle": [0, 0, 10], "rectangle": [0, 0, 1, 1]},
        {"rectangle": [10, 0, 0, 10]},
        {"circle": [0, 0, 0]},
        {"bar": [0, 0, 1, 1, -1]},
        {"polygon": [[0, 0], [1, 1]]},
    ],
)
def test_what_is_no_area_is_refused(table: dict[str, Any]) -> None:
    with pytest.raises(ValidationError, match="expected"):
        Area.model_validate(table)


# visits, stays_inside, keeps_out, touches_nothing


NEAR, FAR = {"name": "the near place", "circle": [300, 800, 30]}, {"name": "the far place", "circle": [600, 800, 30]}


@pytest.mark.parametrize(
    ("keys", "marks"),
    [
        ({"places": [NEAR, FAR]}, 4),
        ({"places": [FAR, NEAR]}, 2),
        ({"places": [FAR, NEAR], "in_order": False}, 4),
        ({"places": [NEAR, {"circle": [300, 900, 30]}], "at_least": 1}, 4),
        ({"places": [NEAR, {"circle": [300, 900, 30]}], "at_least": 2}, 2),
        # The last two places are visited in order, which is enough. The first one is visited too late.
        ({"places": [FAR, {"circle": [150, 800, 10]}, NEAR], "at_least": 2}, 4),
        ({"places": [FAR, {"circle": [150, 800, 10]}, NEAR]}, 2.67),
        ({"places": [NEAR, {"circle": [310, 800, 30]}]}, 4),
        ({"places": [NEAR], "without_stopping": True}, 4),
        ({"places": [{"circle": [500, 800, 30]}], "without_stopping": True}, 0),
        ({"places": [{"circle": [630, 830, 5]}], "of": "left_light"}, 0),
        ({"places": [{"circle": [630, 820, 5]}], "of": "left_light"}, 4),
    ],
)
def test_visits(keys: dict[str, Any], marks: float) -> None:
    run = driven(straight(400), rest(20), straight(100))
    rule = criterion("visits", over="mean", **keys)
    result = judged(rule, run)
    assert float(result.marks) == pytest.approx(marks, abs=0.05), result.message


@given(st.lists(st.sampled_from("ABC"), min_size=1, max_size=4), st.lists(st.sampled_from("ABC"), max_size=6))
@settings(max_examples=60, deadline=None)
def test_as_many_places_in_order_as_an_exhaustive_search_finds(wished: list[str], visited: list[str]) -> None:
    where = {"A": (300.0, 100.0), "B": (600.0, 100.0), "C": (300.0, 500.0)}
    stops = np.array([(1000.0, 1000.0), *(where[name] for name in visited)])
    places = [{"name": name, "circle": [*where[name], 20]} for name in wished]
    run = along(stops, np.zeros(len(stops)))
    chains = [
        size
        for size in range(len(wished) + 1)
        for chosen in itertools.combinations(wished, size)
        for way in itertools.combinations_with_replacement(range(len(visited)), size)
        if all(visited[place] == name for place, name in zip(way, chosen, strict=True))
    ]
    result = judged(criterion("visits", places=places), run)
    assert measured(result, "places visited") == max(chains, default=0)


def test_stopping_at_the_end_is_stopping() -> None:
    rule = criterion("visits", places=[FAR], without_stopping=True)
    assert "not to stop in the far place" in judged(rule, driven(straight(500))).message


def test_leaving_an_area_is_told_with_where_and_how_far() -> None:
    rule = criterion("stays_inside", areas=[{"name": "the loop", "rectangle": [0, 700, 400, 900]}])
    assert passes(rule, driven(straight(300)))
    result = judged(rule, driven(straight(350), straight(-200)))
    assert "at 2.03 s: Expected the robot to stay in the loop, but it left it at (405, 800)" in result.message
    assert measured(result, "farthest out") == pytest.approx(50)
    assert measured(result, "greatest x") == pytest.approx(450)


def test_standing_still_earns_nothing_where_driving_is_asked() -> None:
    for check, area in (("stays_inside", [0, 0, 2362, 1143]), ("keeps_out", [0, 0, 1, 1])):
        rule = criterion(check, areas=[{"rectangle": area}], drives=300)
        assert passes(rule, driven(straight(150), straight(-150)))
        assert "to drive 300 mm or more, but it drove only 0 mm" in judged(rule, driven(rest())).message


def test_several_areas_are_one() -> None:
    halves = [{"rectangle": [0, 700, 250, 900]}, {"rectangle": [250, 700, 500, 900]}]
    assert passes(criterion("stays_inside", areas=halves), driven(straight(300)))
    assert not passes(criterion("keeps_out", areas=halves[1:]), driven(straight(300)))


def test_the_pen_may_be_lifted_over_a_bar() -> None:
    rule = criterion("keeps_out", of="pen", areas=[{"name": "the bar", "bar": [300, 700, 300, 900, 20]}])
    run = driven(straight(400))
    assert "Expected the pen to stay out of the bar" in judged(rule, run).message
    lifted = driven(straight(400), pen=((0, True), (20, False), (60, True)))
    assert passes(rule, lifted)
    assert "has no -p" in judged(rule, driven(straight(400), pen=())).message


def test_touches() -> None:
    touch = Touch(1.0, "an obstacle", Pose(120, 800, 0))
    run = driven(straight(100), touches=(touch,))
    assert "touch nothing, but it touched an obstacle" in judged(criterion("touches_nothing"), run).message
    assert passes(criterion("touches_nothing", at_most=1), run)


@pytest.mark.parametrize(
    ("moves", "keys", "good"),
    [
        ((straight(500),), {"distance": [0, 100]}, False),
        ((straight(500),), {"distance": [90, 110]}, False),
        ((straight(400), spin(90), straight(200)), {"distance": [0, 100]}, True),
        ((spin(30), straight(500)), {"than_straight": "nearer", "first_turn": "towards"}, True),
        ((spin(-30), straight(500)), {"than_straight": "farther", "first_turn": "away"}, True),
        ((spin(-30), straight(500)), {"first_turn": "towards"}, False),
        ((straight(500),), {"first_turn": "towards"}, False),
        ((spin(1, 1), straight(500)), {"first_turn": "towards"}, False),
    ],
)
def test_closest(moves: Any, keys: dict[str, Any], good: bool) -> None:
    assert passes(criterion("closest", x=500, y=1000, **keys), driven(*moves)) is good


@given(st.integers(1, 4), st.sampled_from((-1, 1)), st.floats(0.05, 0.9), points, st.floats(20, 300))
@settings(max_examples=50, deadline=None)
def test_winding_of_circles(whole: int, way: int, part: float, centre: tuple[float, float], radius: float) -> None:
    angles = np.linspace(0, way * (whole + part) * 2 * math.pi, 400)
    path = np.column_stack([centre[0] + radius * np.cos(angles), centre[1] + radius * np.sin(angles)])
    assert compute_rounds(path, *centre)[-1] == pytest.approx(way * (whole + part))
    assert abs(compute_rounds(path, centre[0] + 2 * radius, centre[1])[-1]) < 0.5


@given(st.lists(points, min_size=2, max_size=30))
@settings(max_examples=50, deadline=None)
def test_winding_of_a_path_there_and_back_is_nothing(path: list[tuple[float, float]]) -> None:
    there_and_back = np.array(path + path[::-1])
    assert compute_rounds(there_and_back, 700, 700)[-1] == pytest.approx(0, abs=1e-9)


def loop(side: float, turn: float = 90, rounds_of_it: int = 1) -> list[Any]:
    corner = (turn / 30 * 0.5, turn / 30, 30)
    return [part for _ in range(4 * rounds_of_it) for part in (straight(side / 2), straight(side / 2), corner)]


@pytest.mark.parametrize(
    ("moves", "keys", "good"),
    [
        (loop(300), {"times": [0.9, 1.1]}, True),
        (loop(300), {"times": [0.9, 1.1], "direction": "clockwise"}, False),
        (loop(300, rounds_of_it=2), {"times": [0.9, 1.1]}, False),
        (loop(300, rounds_of_it=3), {"times": [1, 9], "gyro": [330, 390], "corners": 4}, True),
        (loop(300, rounds_of_it=3), {"times": [1, 9], "corners": 3}, False),
        (loop(300, rounds_of_it=3), {"times": [1, 9], "gyro": [0, 330]}, False),
        ([(8.0, 1.5, 600)], {"times": [1, 9], "corners": 4}, False),  # a circle has no corners
    ],
)
def test_circuits(moves: list[Any], keys: dict[str, Any], good: bool) -> None:
    assert passes(criterion("circuits", x=250, y=950, **keys), driven(*moves)) is good


def wavy(offset: float = 0.0, speed: float = 4.0) -> Any:
    """Return a run up the line of the test floor at x 141, ``offset`` mm to its left."""
    line = np.array(load_centrelines()["Line_Following_Test/141"])
    lengths = np.concatenate([[0], np.hypot(*np.diff(line, axis=0).T)]).cumsum()
    places = np.arange(60, lengths[-1], speed)
    x, y = np.interp(places, lengths, line[:, 0]), np.interp(places, lengths, line[:, 1])
    directions = np.unwrap(np.arctan2(np.gradient(y), np.gradient(x)))
    path = np.column_stack([x - offset * np.sin(directions), y + offset * np.cos(directions)])
    return along(path, np.degrees(directions))


LINE = {"on": "Line_Following_Test/141"}


@pytest.mark.parametrize(
    ("run", "keys", "good"),
    [
        (wavy(), {"covers": 0.95, "within": 5, "at_most": 5}, True),
        (wavy(30), {"covers": 0.9, "within": 40, "one_side": 0.95}, True),
        (wavy(30), {"covers": 0.9, "within": 20}, False),
        (wavy(60), {"within": 50}, False),
        (driven(straight(1000), start=Pose(141, 60, 90)), {"covers": 0.9, "within": 20}, False),
        (driven(straight(1000), start=Pose(1000, 60, 90)), {}, False),
    ],
)
def test_following_a_line(run: Any, keys: dict[str, Any], good: bool) -> None:
    assert passes(criterion("follows", line=LINE, **keys), run) is good


STRETCH = {"points": [[300, 300], [1300, 300]]}


@pytest.mark.parametrize(
    ("run", "keys", "share"),
    [
        # The robot stands on the end of the line, crosses it at right angles, or turns around there.
        (driven(rest(30), start=Pose(1300, 300, 0)), {}, 0),
        (driven(spin(90), rest(30), start=Pose(1310, 300, 0)), {}, 0),
        (driven(straight(400), start=Pose(1290, 100, 90)), {}, 0),
        (driven(straight(200), spin(180), straight(200), start=Pose(1200, 300, 0)), {}, 1 / 9),
        # The robot need not drive the part before it joins the line, which it must do within the first tenth.
        (driven(straight(1000), start=Pose(300, 300, 0)), {}, 1),
        (driven(straight(900), start=Pose(400, 300, 0)), {}, 1),
        (driven(straight(850), start=Pose(450, 300, 0)), {}, 850 / 900),
        (driven(straight(500), start=Pose(800, 300, 0)), {}, 5 / 9),
        (driven(straight(500), start=Pose(800, 300, 0)), {"joins_by": 0.5}, 1),
        (driven(straight(900), start=Pose(400, 300, 0)), {"joins_by": 0}, 0.9),
    ],
)
def test_an_open_line_is_followed_from_its_beginning(run: Any, keys: dict[str, Any], share: float) -> None:
    rule = criterion("follows", line=STRETCH, covers=0.999, over="mean", **keys)
    result = judged(rule, run)
    assert measured(result, "share covered") == pytest.approx(share, abs=0.001)
    assert result.evidence[0].passed is (share == 1)


@given(st.floats(0, 1), st.floats(0, 0.9), st.floats(0, 1))
@settings(max_examples=50, deadline=None)
def test_no_more_is_followed_than_was_driven_along(met: float, joins_by: float, left: float) -> None:
    end = max(met, left)
    places = np.linspace(300 + 1000 * met, 300 + 1000 * end, 100)
    run = along(np.column_stack([places, np.full(100, 300.0)]), np.zeros(100))
    result = judged(criterion("follows", line=STRETCH, joins_by=joins_by, within=5), run)
    assert measured(result, "share covered") <= (end - met) / (1 - joins_by) + 1e-6


def test_coming_upon_the_line_too_late_is_told() -> None:
    result = judged(criterion("follows", line=STRETCH), driven(straight(500), start=Pose(800, 300, 0)))
    assert "but it reached it only at 50% of its length, and followed 56% of it" in result.message


def test_going_back_and_forth_over_the_line_is_not_one_side() -> None:
    line = {"points": [[0, 0], [1000, 0]]}
    places = np.arange(0, 1000, 5.0)
    weaving = along(np.column_stack([places, 20 * np.sin(places / 30)]), np.zeros(len(places)))
    result = judged(criterion("follows", line=line, one_side=0.9), weaving)
    assert "for 90% of the time" in result.message
    assert measured(result, "share covered") == pytest.approx(0.995)


def test_a_short_cut_does_not_cover_what_it_leaves_out() -> None:
    hairpin = {"points": [[0, 0], [1000, 0], [1000, 300], [0, 300]]}
    there, over, back = np.arange(0, 300, 5.0), np.arange(0, 300, 5.0), np.arange(300, 0, -5.0)
    parts = ((there, 0 * there), (300 + 0 * over, over), (back, 300 + 0 * back))
    path = np.concatenate([np.column_stack(part) for part in parts])
    result = judged(criterion("follows", line=hairpin, over="mean"), along(path, np.zeros(len(path))))
    assert measured(result, "share covered") < 0.2


def test_driving_against_the_direction_covers_nothing() -> None:
    ring = {"ellipse": [500, 500, 200, 200]}
    angles = np.linspace(0, -2 * math.pi, 500)
    circle = np.column_stack([500 + 200 * np.cos(angles), 500 + 200 * np.sin(angles)])
    result = judged(criterion("follows", line=ring), along(circle, np.degrees(angles)))
    assert measured(result, "share covered") < 0.05


@given(st.floats(0.1, 1.0), st.floats(0, 40), st.integers(-1, 1))
@settings(max_examples=25, deadline=None)
def test_what_is_driven_of_a_circle_is_covered(part: float, off: float, way: int) -> None:
    course = LineToFollow(ellipse=(0, 0, 300, 300))
    angles = np.linspace(0, part * 2 * math.pi, 300)
    radius = 300 + way * off
    line_progress = along_line(course, radius * np.column_stack([np.cos(angles), np.sin(angles)]), 50)
    assert line_progress is not None
    assert measure_covered_share(line_progress, 50, 0, line_progress.length) == pytest.approx(part, abs=0.01)
    assert np.abs(line_progress.offset).max() == pytest.approx(off if way else 0, abs=0.2)
    assert line_progress.length == pytest.approx(2 * math.pi * 300, rel=1e-3)


def circling(laps: float, seconds_a_lap: float, off: float = 0.0) -> Any:
    """Circle anticlockwise around (500, 500) with radius 300 mm, from just below the start line on its right."""
    count = round(laps * seconds_a_lap * 30)
    angles = -0.1 + np.linspace(0, laps * 2 * math.pi, count + 1)
    radius = 300 + off * np.sin(angles / 2) ** 2
    path = np.column_stack([500 + radius * np.cos(angles), 500 + radius * np.sin(angles)])
    return along(path, np.degrees(angles) + 90)


def round_by(*degrees: float) -> Any:
    """Return a run around the circle to each of these places in turn, in degrees from its easternmost point."""
    angles = np.radians(np.concatenate([np.linspace(a, b, 120) for a, b in itertools.pairwise(degrees)]))
    return np.column_stack([500 + 300 * np.cos(angles), 500 + 300 * np.sin(angles)])


def test_a_lap_is_whole_though_the_robot_began_twice() -> None:
    """The robot crosses the start line, leaves the track, is put back before the line, and drives a clean lap."""
    aside = np.linspace([793, 558], [950, 600], 30)
    run = np.concatenate([round_by(-10, 11), aside, aside[::-1], round_by(11, -10), round_by(-10, 360 + 10)])
    result = judged(criterion("laps", **CIRCUIT), along(run, np.zeros(len(run))))
    assert result.marks == 4, result.message


@pytest.mark.long
@given(st.lists(st.tuples(st.sampled_from((-400, 0, 300, 700, 1000)), st.booleans()), min_size=2, max_size=7))
@example([(300, False), (0, False), (700, False), (300, False)])
@settings(max_examples=100, deadline=None)
def test_laps_are_those_that_an_exhaustive_search_finds(ways: list[tuple[int, bool]]) -> None:
    """Between two crossings the robot moves a distance along a line of 1000 mm, and leaves the line or not."""
    progress = np.concatenate([[0], np.cumsum([way for way, _ in ways])]).astype(float)
    crossings = [Crossing(float(row), row, float(at)) for row, at in enumerate(progress)]
    offsets = np.zeros((len(progress) - 1) * 2 + 1)
    offsets[1::2] = [100 if leaves else 0 for _, leaves in ways]
    line_progress = LineProgress(0, np.repeat(progress, 2)[:-1], offsets, 1000)
    crossings = [Crossing(each.t, 2 * each.row, each.progress) for each in crossings]
    clean = [
        (first.t, last.t)
        for first, last in itertools.combinations(crossings, 2)
        if last.progress - first.progress >= 995 and not any(leaves for _, leaves in ways[int(first.t) : int(last.t)])
    ]
    most = max(
        size
        for size in range(len(ways) + 1)
        for chosen in itertools.combinations(clean, size)
        if all(one[1] <= other[0] for one, other in itertools.pairwise(sorted(chosen)))
    )
    rule = criterion("laps", **CIRCUIT)
    assert isinstance(rule, Laps)
    complete = find_complete_laps(rule, line_progress, crossings)
    assert complete.count == most
    assert min((lap.seconds for lap in complete.laps), default=0) == min((b - a for a, b in clean), default=0)


def test_the_best_lap_is_timed_from_the_crossing_nearest_before_it() -> None:
    run = round_by(-10, 10, -10, 370)
    result = judged(criterion("laps", **CIRCUIT), along(run, np.zeros(len(run))))
    assert measured(result, "lap time") == pytest.approx(3.76, abs=0.01)


CIRCUIT = {"line": {"ellipse": [500, 500, 300, 300], "name": "the track"}, "start_line": [750, 500, 850, 500]}


def test_laps_are_timed_between_crossings() -> None:
    result = judged(criterion("laps", **CIRCUIT), circling(2.2, 10.5))
    assert result.marks == 4, result.message
    assert measured(result, "lap time") == pytest.approx(10.5, abs=0.001)
    assert measured(result, "laps") == 2


@pytest.mark.parametrize(
    ("run", "keys", "good"),
    [
        (circling(1.1, 10), {}, True),
        (circling(1.1, 10), {"laps": 2}, False),
        (circling(0.9, 10), {}, False),
        (circling(1.1, 10), {"seconds": [0, 9]}, False),
        (circling(1.1, 10, off=80), {}, False),
        (circling(1.1, 10, off=50), {}, True),
        (circling(-1.1, -10), {}, False),
        (driven(straight(500)), {}, False),
    ],
)
def test_laps(run: Any, keys: dict[str, Any], good: bool) -> None:
    assert passes(criterion("laps", **CIRCUIT, **keys), run) is good


def test_rocking_on_the_start_line_is_no_lap() -> None:
    angles = -0.1 + 0.2 * np.abs(np.sin(np.linspace(0, 20, 400)))
    path = np.column_stack([500 + 300 * np.cos(angles), 500 + 300 * np.sin(angles)])
    result = judged(criterion("laps", **CIRCUIT), along(path, np.full(400, 90.0)))
    assert result.marks == 0
    assert "crossed the start line" in result.message


@pytest.mark.parametrize(
    "table",
    [
        {},
        {"on": "Line_Following_Test/9"},
        {"points": [[0, 0]]},
        {"points": [[0, 0], [0, 0]]},
        {"ellipse": [0, 0, 10, 10], "arc": [0, 720]},
        {"ellipse": [0, 0, 0, 10]},
        {"on": "Thruxton_Circuit", "points": [[0, 0], [1, 1]]},
    ],
)
def test_what_is_no_line_is_refused(table: dict[str, Any]) -> None:
    with pytest.raises(ValidationError, match="expected"):
        LineToFollow.model_validate(table)


def test_named_lines_start_where_the_robots_start() -> None:
    starts = {name: line[0] for name, line in load_centrelines().items()}
    for name in ("141", "440", "771", "1076", "1453", "1821"):
        x, y = starts[f"Line_Following_Test/{name}"]
        assert abs(x - int(name)) <= 2
        assert round(y) == 46
    assert LineToFollow(on="Thruxton_Circuit").length() == pytest.approx(3850, rel=0.01)
    assert all(0 <= y <= 1143 for line in load_centrelines().values() for _, y in line)


@pytest.mark.parametrize(
    "rule",
    [
        criterion("visits", places=[NEAR]),
        criterion("stays_inside", areas=[{"circle": [100, 800, 1]}]),
        criterion("keeps_out", areas=[NEAR]),
        criterion("keeps_out", areas=[NEAR], of="pen"),
        criterion("closest", x=0, y=0, distance=[0, 10]),
        criterion("circuits", x=0, y=0, times=[1, 2]),
        criterion("follows", line=LINE),
        criterion("laps", **CIRCUIT),
        criterion("drawing", legs=4),
        criterion("moves", moves=[{"forward": [1, 2]}]),
        criterion("excursions", heights=[1]),
        criterion("encounters", below=40),
        criterion("displacement", turn=[90, 90]),
    ],
    ids=lambda rule: rule.check,
)
def test_a_run_without_a_tick_is_judged(rule: Any) -> None:
    result = judged(rule, driven())
    assert result.message
    assert len(compute_positions(driven())) == 1


@pytest.mark.parametrize(
    ("keys", "good"),
    [
        ({"areas": [{"rectangle": [0, 700, 300, 900], "outside": True}]}, True),
        ({"areas": [{"rectangle": [0, 700, 250, 900], "outside": True}]}, False),
        ({"areas": [{"rectangle": [0, 700, 300, 900], "outside": True}], "clear_of": 40}, True),
        ({"areas": [{"rectangle": [0, 700, 300, 900], "outside": True}], "clear_of": 60}, False),
        ({"areas": [{"circle": [200, 1000, 100]}], "clear_of": 100}, True),
        ({"areas": [{"circle": [200, 1000, 100]}], "clear_of": 101}, False),
    ],
)
def test_the_outside_of_an_area_and_a_distance_are_kept(keys: dict[str, Any], good: bool) -> None:
    """The robot drives from (100, 800) to (260, 800)."""
    assert passes(criterion("keeps_out", **keys), driven(straight(160))) is good


def test_how_near_it_came_to_the_outside_is_told() -> None:
    inside = {"name": "the arena", "rectangle": [0, 700, 300, 900], "outside": True}
    result = judged(criterion("keeps_out", areas=[inside], clear_of=60), driven(straight(160)))
    messages = (
        "keep 60 mm from the outside of the arena, but it came too near at (245, 800); its smallest distance was 40 mm"
    )
    assert messages in result.message
    assert measured(result, "least clearance") == pytest.approx(40)


@pytest.mark.parametrize(("check", "good"), [("stays_inside", False), ("visits", True)])
def test_the_outside_is_an_area_like_any_other(check: str, good: bool) -> None:
    area = [{"circle": [100, 800, 50], "outside": True}]
    keys = {"places": area} if check == "visits" else {"areas": area}
    assert passes(criterion(check, **keys), driven(straight(160))) is good
