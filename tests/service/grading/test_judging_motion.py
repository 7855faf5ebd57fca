"""Judging how the robot moved: displacement, moves, excursions, encounters and drawings, with runs made by hand."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from driving import driven, measured, passes, rest, spin, straight
from judging import criterion, judged
from service.grading.judging.drawing import compute_turn_angle, find_legs
from service.grading.judging.moves import split_moves
from sim.recording import Pose

pytestmark = pytest.mark.fast

WHITE, BLACK = (255, 255, 255), (0, 0, 0)


@pytest.mark.parametrize(
    ("keys", "good"),
    [
        ({"forward": [295, 305]}, True),
        ({"forward": [0, 299]}, False),
        ({"sideways": [-1, 1], "turn": [89, 91]}, True),
        ({"turn": [-91, -89]}, False),
        ({"turn_size": [90, 90]}, True),
        ({"distance": [300, 300], "agrees_with_wheels": 0.01}, True),
        ({"left_wheel": [600, 630]}, True),
        ({"left_wheel": [1000, 1100]}, False),
        ({"seconds": [0, 1]}, False),
    ],
)
def test_displacement_from_start_to_end(keys: dict[str, Any], good: bool) -> None:
    run = driven(straight(300), rest(), spin(90))
    assert passes(criterion("displacement", **keys), run) is good


def test_displacement_is_seen_from_how_the_robot_stood() -> None:
    result = judged(criterion("displacement", forward=[90, 110]), driven(straight(100), start=Pose(500, 500, 90)))
    assert result.marks == 4
    assert measured(result, "displacement") == pytest.approx(100)


def test_wheels_that_did_not_carry_the_robot_are_told() -> None:
    there_and_back = driven(straight(200), rest(), straight(-200))
    result = judged(criterion("displacement", agrees_with_wheels=0.05), there_and_back)
    assert "400 mm according to its left wheel's position" in result.message


def test_moves_are_parted_by_rests_and_by_kind() -> None:
    run = driven(straight(100), rest(4), straight(50), rest(2), straight(50), spin(90), rest(), straight(-60))
    made = split_moves(run)
    assert [round(move.distance) for move in made] == [100, 100, 0, 60]
    assert [round(move.turn) for move in made] == [0, 0, 90, 0]
    assert made[3].forward == pytest.approx(-60)


def test_a_short_slip_into_a_bend_is_no_move_of_its_own() -> None:
    assert len(split_moves(driven(straight(50), (5.0, 1.0, 4), straight(50)))) == 1


RIGHT_ANGLE = [
    {"name": "driving", "forward": [50, 250]},
    {"name": "the right angle", "turn_size": [85, 95], "distance": [0, 20]},
]


@pytest.mark.parametrize(
    ("moves", "keys", "good"),
    [
        ((straight(100), rest(), spin(90)), {}, True),
        ((straight(100), rest(), spin(-90)), {}, True),
        ((straight(100), rest(), spin(30), rest(), spin(90)), {}, True),
        ((straight(100), rest(), spin(30), rest(), spin(90)), {"only": True}, False),
        ((spin(90), rest(), straight(100)), {}, False),
        ((spin(90), rest(), straight(100)), {"in_order": False}, True),
        ((straight(100), rest(), spin(111)), {}, False),
        ((rest(),), {}, False),
        ((), {}, False),
    ],
)
def test_moves_in_order(moves: Any, keys: dict[str, Any], good: bool) -> None:
    assert passes(criterion("moves", moves=RIGHT_ANGLE, **keys), driven(*moves)) is good


@pytest.mark.parametrize(
    ("made", "moves"),
    [
        ((straight(100), straight(-60)), [{"forward": [95, 105]}, {"forward": [-65, -55]}]),
        ((spin(90), spin(-45)), [{"turn": [85, 95]}, {"turn": [-50, -40]}]),
        (
            (straight(100), spin(90), spin(-90), straight(-100)),
            [{"forward": [95, 105]}, {"turn": [85, 95]}, {"turn": [-95, -85]}, {"forward": [-105, -95]}],
        ),
        # A move of less than 0.3 s belongs to the move around it.
        ((straight(100), straight(-20), straight(100)), [{"forward": [175, 185]}]),
        ((spin(60), spin(-6), spin(60)), [{"turn": [110, 118]}]),
        # A bend counts as a turn, whether the robot drives forwards or backwards.
        ((straight(100), (4.0, 2.0, 20)), [{"turn": [-1, 1]}, {"turn": [38, 42]}]),
    ],
)
def test_forwards_and_backwards_left_and_right_are_moves_of_their_own(made: Any, moves: list[dict[str, Any]]) -> None:
    assert passes(criterion("moves", moves=moves, only=True), driven(*made))


@pytest.mark.parametrize(
    ("keys", "made", "marks"),
    [
        # The first move matches both requirements, the second move only the first one.
        ({"in_order": False}, (80, 200), 4),
        ({"in_order": False}, (200, 80), 4),
        ({"in_order": False}, (200, 220), 2),
        # The last two required moves occurred, in order.
        ({"then": 300}, (80, 300, 200), 2.67),
    ],
)
def test_moves_are_paired_so_that_most_are_found(keys: dict[str, Any], made: Sequence[float], marks: float) -> None:
    wide, narrow = {"forward": [50, 300]}, {"forward": [50, 100]}
    required_moves = (
        [{"forward": [190, 210]}, {"forward": [70, 90]}, {"forward": [keys["then"]] * 2}] if "then" in keys else []
    )
    keys = {key: value for key, value in keys.items() if key != "then"}
    run = driven(*(part for mm in made for part in (straight(mm), rest())))
    result = judged(criterion("moves", moves=required_moves or [wide, narrow], over="mean", **keys), run)
    assert float(result.marks) == marks, result.message


def test_a_missing_move_tells_what_came_instead_and_when() -> None:
    result = judged(criterion("moves", moves=RIGHT_ANGLE, over="mean"), driven(straight(100), rest(), spin(111)))
    assert result.marks == 2
    assert (
        "at 2.03 s: Expected the right angle: a move of 0 to 20 mm away from where it began, 85 to 95° of turn, "
        "but the robot turned 111.0° left in 1.23 s." in result.message
    )
    assert measured(result, "move 1 forward") == pytest.approx(100)
    none = judged(criterion("moves", moves=RIGHT_ANGLE), driven())
    assert "the robot did not move at all" in none.message


def there_and_back(*heights: float, back: float = 0.0) -> Any:
    """Return excursions to each height and back to ``back`` mm from their start."""
    moves = []
    for height in heights:
        moves += [straight(height), rest(), straight(back - height), rest()]
    return driven(*moves)


@pytest.mark.parametrize(
    ("heights", "back", "good"),
    [
        ((100, 200, 100), 0, True),
        ((-100, -200, -100), 0, True),
        ((100, 200, 100), 10, False),  # the third return is 30 mm off
        ((100, 200, 105), 0, True),
        ((100, 200, 150), 0, False),
        ((40, 80, 40), 0, False),
        ((100, 200), 0, False),
        ((100, 200, 100, 200), 0, False),
    ],
)
def test_excursions_in_proportion(heights: tuple[float, ...], back: float, good: bool) -> None:
    run = there_and_back(*heights, back=back)
    assert passes(criterion("excursions", heights=[1, 2, 1]), run) is good


def test_an_excursion_without_a_return_is_told() -> None:
    result = judged(
        criterion("excursions", heights=[1, 1]), driven(straight(100), rest(), straight(-100), straight(60))
    )
    assert result.marks == 0
    assert "Expected the robot to go out " in result.message
    still = judged(criterion("excursions", heights=[1, 1]), driven())
    assert "it never did" in still.message


@pytest.mark.parametrize(
    ("heights", "moves", "score", "expected_words"),
    [
        ([1], (straight(100),), 0.5, "it ended 100 mm from it"),
        ([1, 1], (straight(100), straight(-100), straight(100)), 0.75, "it ended 100 mm from it"),
        ([1], (straight(100), straight(-60)), 0.5, "it ended 40 mm from it"),
        # Back along the same way, and then off to the side.
        ([1], (straight(100), straight(-100), spin(90), straight(300)), 0.5, "it ended 300 mm from it"),
        # Level with the start, and to the side of it.
        (
            [1, 1],
            (straight(100), spin(90), straight(100), spin(90), straight(100), straight(-100), straight(100)),
            0.5,
            "the first time it came back to 100 mm",
        ),
    ],
)
def test_each_excursion_comes_back_to_the_start(
    heights: list[int], moves: Any, score: float, expected_words: str
) -> None:
    rule = criterion("excursions", heights=heights, over="mean")
    result = judged(rule, driven(*moves))
    assert float(result.marks) == 4 * score, result.message
    assert expected_words in result.message


@given(st.lists(st.sampled_from((1, 2, 3)), min_size=1, max_size=5), st.sampled_from((60, 100)))
@settings(max_examples=30, deadline=None)
def test_excursions_as_asked_pass_and_their_peaks_are_measured(heights: list[int], unit: int) -> None:
    result = judged(criterion("excursions", heights=heights), there_and_back(*[unit * height for height in heights]))
    assert result.marks == 4, result.message
    assert [measured(result, f"peak {n}") for n in range(1, len(heights) + 1)] == pytest.approx(
        [unit * height for height in heights]
    )


def seeing(dark: range, count: int) -> list[tuple[int, int, int]]:
    return [BLACK if tick in dark else WHITE for tick in range(count)]


@pytest.mark.parametrize(
    ("after", "good"),
    [
        ((straight(-20), rest(), spin(90)), True),
        ((spin(90), straight(-20)), False),  # the reverse order
        ((straight(-20), rest(40)), False),
        ((rest(120), straight(-20), spin(90)), False),  # too late
    ],
)
def test_encounters_are_answered_in_order_and_in_time(after: Any, good: bool) -> None:
    moves = (straight(100), *after)
    count = sum(ticks for _, _, ticks in moves)
    run = driven(*moves, rgb=seeing(range(18, 22), count))
    rule = criterion("encounters", light="left", below=40, then=["reverse", "turn"], seconds=3)
    assert passes(rule, run) is good


def test_an_unanswered_encounter_is_pointed_at() -> None:
    moves = (straight(100), straight(-20), spin(90), straight(100))
    count = sum(ticks for _, _, ticks in moves)
    rgb = [BLACK if tick in (18, 60) else WHITE for tick in range(count)]
    result = judged(criterion("encounters", light="left", below=40, at_least=2, over="mean"), driven(*moves, rgb=rgb))
    assert result.marks == 2
    assert "at 2.03 s" in result.message
    never = judged(criterion("encounters", light="left", below=40), driven(*moves))
    assert "never fell below 40 %" in never.message


def square(side: float, angle: float = 90, legs: int = 4) -> list[Any]:
    return [part for _ in range(legs) for part in (straight(side), rest(), spin(angle), rest())]


@pytest.mark.parametrize(
    ("moves", "keys", "good"),
    [
        (square(200), {}, True),
        (square(200, -90), {}, True),
        (square(200, 99), {}, False),
        (square(200, legs=3), {}, False),
        (square(40), {}, False),
        (square(200) + square(300), {}, False),
        (square(200) + square(300), {"figures": 2, "growing": True}, True),
        (square(300) + square(200), {"figures": 2, "growing": True}, False),
        (square(300) + square(300.5), {"figures": 2, "growing": True}, False),
        (square(200) + square(300), {"figures": 2, "sizes": [[150, 250], [150, 250]]}, False),
        (square(200) + square(300), {"figures": 1, "at_least": True}, True),
        ([straight(200), spin(90), straight(240), spin(90), straight(200), spin(90), straight(240)], {}, True),
        ([straight(200), spin(90), straight(260), spin(90), straight(200), spin(90), straight(260)], {}, False),
    ],
)
def test_squares(moves: list[Any], keys: dict[str, Any], good: bool) -> None:
    assert passes(criterion("drawing", legs=4, closes=True, **keys), driven(*moves)) is good


def test_what_is_wrong_with_a_drawing_is_told() -> None:
    rule = criterion("drawing", legs=4, closes=True)
    assert "no -p" in judged(rule, driven(*square(200), pen=())).message
    assert "after leg 1 the robot turned 99.0°" in judged(rule, driven(*square(200, 99))).message
    assert "Expected 4 straight legs, but the path has none." in judged(rule, driven()).message
    open_square = [straight(200), spin(90), straight(200), spin(90), straight(200), spin(90), straight(160)]
    gap = judged(criterion("drawing", legs=4, closes=True, equal_within=0.3), driven(*open_square))
    assert "the end is 40 mm away" in gap.message
    assert passes(criterion("drawing", legs=4, pen=False), driven(*square(200), pen=()))


def test_only_what_the_pen_draws_are_legs() -> None:
    moves = (straight(200), rest(), spin(90), rest(), straight(200))
    lifted = driven(*moves, pen=((0, True), (45, False)))
    assert [round(leg.length) for leg in find_legs(lifted, pen=True)] == [200]
    assert [round(leg.length) for leg in find_legs(lifted, pen=False)] == [200, 200]


def lifted_between(first: Sequence[Any], between_them: Sequence[Any], second: Sequence[Any]) -> Any:
    """Return a run of these moves with the pen up during the middle ones."""
    up = sum(ticks for _, _, ticks in first)
    down = up + sum(ticks for _, _, ticks in between_them)
    return driven(*first, *between_them, *second, pen=((0, True), (up, False), (down, True)))


ASIDE = (spin(90), straight(100), spin(-90))
#: About 100 mm to the left, then on in the same direction.
BEND = ((5.0, 2.0, 35), (5.0, -2.0, 35))


@pytest.mark.parametrize(
    ("run", "lengths"),
    [
        # Parallel strokes, a dashed line, one stroke over another.
        (lifted_between([straight(200)], ASIDE, [straight(200)]), [200, 200]),
        (lifted_between([straight(200)], [straight(50)], [straight(200)]), [200, 200]),
        (lifted_between([straight(200)], [straight(-200)], [straight(200)]), [200, 200]),
        # With the pen down, a bend also counts as a corner, whatever the next direction is.
        (driven(straight(200), *BEND, straight(200)), [200, 200]),
        # A rest, a slip and a short bend to the side do not count.
        (driven(straight(200), rest(30), straight(200)), [400]),
        (driven(straight(200), (5.0, 1.0, 4), (5.0, -1.0, 4), straight(200)), [440]),
    ],
)
def test_only_what_goes_on_in_one_line_is_one_leg(run: Any, lengths: list[int]) -> None:
    assert [leg.length for leg in find_legs(run, pen=True)] == pytest.approx(lengths, abs=1)


@given(st.lists(st.tuples(st.integers(40, 200), st.sampled_from((0, 30, 100))), min_size=1, max_size=5))
@settings(max_examples=30, deadline=None)
def test_each_stroke_of_a_hatching_is_a_leg(strokes: list[tuple[int, int]]) -> None:
    """All strokes have the same direction. Between them the pen is up, and the robot moves forwards or sideways."""
    moves: list[Any] = []
    pen: list[tuple[int, bool]] = []
    for length, aside in strokes:
        pen.append((sum(ticks for _, _, ticks in moves), True))
        moves.append(straight(5 * round(length / 5)))
        pen.append((sum(ticks for _, _, ticks in moves), False))
        moves += [spin(90), straight(aside), spin(-90), straight(40)]
    run = driven(*moves, pen=tuple(pen))
    assert [leg.length for leg in find_legs(run, pen=True)] == pytest.approx([5 * round(mm / 5) for mm, _ in strokes])


@given(st.integers(3, 8), st.integers(60, 400), st.sampled_from((-1, 1)), st.integers(0, 359))
@settings(max_examples=40, deadline=None)
def test_regular_polygons_are_recognised_in_any_direction(sides: int, side: int, way: int, heading: int) -> None:
    angle = 360 / sides
    turn = (0.0, way * angle / 30, 30)
    moves = [part for _ in range(sides) for part in ((side / 30, 0.0, 30), rest(), turn, rest())]
    run = driven(*moves, start=Pose(1000, 500, heading))
    assert passes(criterion("drawing", legs=sides, angle=angle, angle_within=0.1, closes=True, shortest=50), run)
    legs = find_legs(run, pen=True)
    assert [leg.length for leg in legs] == pytest.approx([side] * sides, abs=1e-6)
    turned = sum(
        compute_turn_angle(one.direction, other.direction)
        for one, other in zip(legs, [*legs[1:], legs[0]], strict=True)
    )
    assert turned == pytest.approx(way * 360, abs=1e-6)


def test_spread_tells_each_level_of_noise() -> None:
    rule = criterion("spread", x=200, y=800)
    result = judged(rule, driven(straight(100)), driven(straight(140)), motor_noise=20)
    assert result.marks == 4
    assert result.message == (
        "The robot ended at these distances from (200, 800): with motor noise 20 0 to 40 mm (mean 20, 2 runs)."
    )
    near = judged(criterion("spread", x=200, y=800, within=10), driven(straight(100)), driven(straight(140)))
    assert near.marks == 2
    assert "it ended 40 mm from it" in near.message
