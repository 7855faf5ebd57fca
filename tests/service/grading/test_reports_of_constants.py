"""A constant text is not a reading: a program that reports without a sensor passes at few of the differing poses."""

from __future__ import annotations

from dataclasses import replace
from decimal import Decimal
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from judging import criterion, judged, recorded, talk
from service.grading.grade import TrialResult
from service.grading.guessable_reports import find_guessable_reports
from service.grading.judging.judge import judge
from sim.floors import build_floor, list_label_names
from sim.recording import Pose, Recording, TimedText
from submissions.assignment.definition import Assignment, Parts, Scenario, WorldSpec
from submissions.assignment.reader import find_assignment

_TEXTS = st.sampled_from(["rows", "columns", "red", "grey", "dark grey"])
_NUMBERS = st.integers(0, 4)
_ENTRIES = _TEXTS | _NUMBERS
_SHAPES = st.lists(st.sampled_from([_TEXTS, _NUMBERS]), min_size=1, max_size=3)
_ROWS = (_SHAPES.map(lambda shape: st.tuples(*shape)) | st.just(st.lists(_ENTRIES, min_size=1, max_size=3))).flatmap(
    lambda row: st.lists(row.map(list), min_size=2, max_size=6, unique_by=tuple)
)
_SHARED_ROWS = _ROWS.flatmap(
    lambda rows: st.lists(st.sampled_from(rows), max_size=6).map(lambda repeated: [*rows, *repeated])
)


def _record_speech(text: str) -> Recording:
    return recorded(printed=(TimedText(1.0, text),))


def _places(count: int) -> tuple[Pose, ...]:
    return tuple(Pose(100 + place, 800, 0) for place in range(count))


def _passes(rows: list[list[Any]], text: str) -> int:
    """Return the number of poses at which the constant text passes."""
    rule = criterion("reports", expected=rows, tolerance=0.4, strays=1000)
    result = judged(rule, *[_record_speech(text)] * len(rows), poses=_places(len(rows)))
    return sum(evidence.passed for evidence in result.evidence)


def _scores(rows: list[list[Any]], text: str, over: str) -> tuple[Decimal, list[Decimal]]:
    """Return the marks of the constant text, out of 4, and those at each pose alone."""
    rule = criterion("reports", expected=rows, tolerance=0.4, strays=1000, over=over)
    poses = _places(len(rows))
    runs = [_record_speech(text)] * len(rows)
    assignment = Assignment("a", "A", WorldSpec(), Parts(), (Scenario("s", poses),), (rule,))
    trials = tuple(TrialResult("s", n, 1, 0.0, 0.0, "visible", run, place=n) for n, run in enumerate(runs))
    alone = [judge(assignment, (trial,))[0].marks for trial in trials]
    return judge(assignment, trials)[0].marks, alone


def _most(rows: list[list[Any]]) -> int:
    """Return the allowed passes of a constant text: half of the poses, or those that share one row, if more."""
    return max(len(rows) // 2, *(rows.count(row) for row in rows))


@pytest.mark.long
@given(_ROWS | _SHARED_ROWS, st.data())
def test_no_constant_text_passes_at_more_than_half_of_the_poses(rows: list[list[Any]], data: st.DataObject) -> None:
    entries = [entry for row in rows for entry in row]
    parts = st.sampled_from(["or", "and", *entries]) | st.sampled_from(rows).map(lambda row: " ".join(map(str, row)))
    constant_parts = data.draw(st.lists(parts, min_size=1, max_size=12))
    assert _passes(rows, " ".join(map(str, constant_parts))) <= _most(rows)


@pytest.mark.long
@given(_ROWS | _SHARED_ROWS, st.sampled_from(["mean", "median", "worst"]), st.data())
def test_no_constant_text_earns_anything_at_more_than_half_of_the_poses(
    rows: list[list[Any]], over: str, data: st.DataObject
) -> None:
    beginnings = [row[:count] for row in rows for count in range(1, len(row) + 1)]
    constant_parts = data.draw(st.lists(st.sampled_from(beginnings), min_size=1, max_size=8))
    total, alone = _scores(rows, " ".join(str(entry) for each in constant_parts for entry in each), over)
    paid = sum(marks > 0 for marks in alone)
    assert paid <= _most(rows)
    if 2 * paid <= len(rows):
        assert total <= 2


_FOUR = [[1, 2, 3, 4], [5, 6, 7, 8], [9, 10, 11, 12], [13, 14, 15, 16]]
_SIDES = [["left", 10], ["left", 20], ["left", 30], ["left", 40]]


@pytest.mark.parametrize("over", ["mean", "median", "worst"])
@pytest.mark.parametrize(
    ("rows", "text"),
    [
        (_FOUR, "1 2 3 5 6 7 9 10 11 13 14 15"),
        (_FOUR, "1 5 9 13"),
        (_FOUR, " ".join(map(str, range(1, 17)))),
        (_SIDES, "left"),
        ([[f"a{n}", f"b{n}", f"c{n}"] for n in range(5)], " ".join(f"a{n} b{n}" for n in range(5))),
        ([[5, 1], [5, 2], [5, 3, 4], [7, 1]], "5"),
        ([["left", 10], ["left", 10], ["left", 20], ["right", 5]], "left"),
    ],
)
def test_beginnings_of_most_rows_are_worth_nothing(rows: list[list[Any]], text: str, over: str) -> None:
    assert _scores(rows, text, over)[0] == 0


@pytest.mark.parametrize(
    ("rows", "text", "alone"),
    [
        (_FOUR, "1 2 3", [3, 0, 0, 0]),
        (_FOUR, "1 2 3 5 6 7", [3, 3, 0, 0]),
        (_FOUR, "1 2 3 4 5 6 7 8 9 10 11 13 14 15", [4, 4, 0, 0]),
        (_FOUR, "1 2 3 5 9", [3, 0, 0, 0]),
        (_SIDES, "left 10", [4, 0, 0, 0]),
        ([[1, 2], [1, 2], [1, 2], [3, 4]], "1", [2, 2, 2, 0]),
        ([[1, 2], [1, 2]], "1", [2, 2]),
        ([[7], [7, 8], [9, 1], [7]], "7", [4, 0, 0, 4]),
    ],
)
def test_beginnings_of_few_rows_are_worth_their_part(rows: list[list[Any]], text: str, alone: list[int]) -> None:
    assert _scores(rows, text, "mean")[1] == alone


def _labelled(background: str) -> dict[str, Pose]:
    """Return a start pose for each label of the floor, and one for no label, by label."""
    places = {
        each.label: Pose(each.x + each.width / 2 - 30, each.y + each.height / 2 - 20, 0)
        for each in build_floor(background).labels
    }
    return places | {"nothing": Pose(5, 5, 0)}


def _passes_at_labels(background: str, text: str, **keys: Any) -> list[str]:
    """Return the labels at which the constant text passes."""
    rule = criterion("reports", expected="label", strays=1000, **keys)
    places = _labelled(background)
    runs = [recorded(background=background, start=pose, printed=(TimedText(1.0, text),)) for pose in places.values()]
    result = judged(rule, *runs, poses=tuple(places.values()))
    return [label for label, evidence in zip(places, result.evidence, strict=True) if evidence.passed]


_KEYS_OF_LABELS = st.fixed_dictionaries(
    {
        "over": st.sampled_from(["share", "mean", "median", "worst"]),
        "only": st.booleans(),
        "among": st.sampled_from([[], ["square"], ["7"]]),
        "tolerance": st.sampled_from([0, 0.5, 1, 9]),
    }
)


@pytest.mark.long
@given(st.sampled_from(["Simple_Shapes", "MNIST_Digits"]), _KEYS_OF_LABELS, st.data())
def test_a_list_of_labels_passes_at_one_of_them_at_most(
    background: str, keys: dict[str, Any], data: st.DataObject
) -> None:
    labels = st.sampled_from([*list_label_names(background), "nothing"])
    numbers = st.integers(-1, 20).map(lambda half: str(half / 2))
    reported_labels = data.draw(
        st.lists(labels | numbers if background == "MNIST_Digits" else labels, min_size=1, max_size=12)
    )
    assert len(_passes_at_labels(background, ", ".join(reported_labels), **keys)) <= 1


@pytest.mark.parametrize("background", ["Simple_Shapes", "MNIST_Digits"])
@pytest.mark.parametrize("only", [False, True])
def test_a_label_alone_passes_where_the_floor_has_it(background: str, only: bool) -> None:
    for label in _labelled(background):
        assert _passes_at_labels(background, f"This is {label}!", only=only) == [label]


_SQUARE, _NOWHERE = _labelled("Simple_Shapes")["square"], Pose(5, 5, 0)


@pytest.mark.parametrize(
    ("world", "poses", "warned"),
    [
        (WorldSpec("Simple_Shapes"), [_SQUARE, _SQUARE, _NOWHERE], "one label of the floor fits 2 of the 3 poses"),
        (WorldSpec("Simple_Shapes"), [_SQUARE, _NOWHERE], ""),
        (WorldSpec("Simple_Shapes"), [_SQUARE, _SQUARE], ""),
        (WorldSpec("Shuffled_Shapes", sheet=None), [_SQUARE, _SQUARE, _NOWHERE], ""),
        (WorldSpec("Empty_Map"), [_SQUARE, _SQUARE, _NOWHERE], ""),
    ],
)
def test_a_label_that_fits_most_poses_is_warned_of(world: WorldSpec, poses: list[Pose], warned: str) -> None:
    rule = criterion("reports", expected="label")
    warnings = list(
        find_guessable_reports(Assignment("a", "A", world, Parts(), (Scenario("s", tuple(poses)),), (rule,)))
    )
    assert [warned in warning for warning in warnings] == [True] * bool(warned)


@pytest.mark.long
@given(_ROWS | _SHARED_ROWS, st.sampled_from([" ", " or ", ", ", " | columns "]))
def test_neither_does_one_that_has_everything(rows: list[list[Any]], between: str) -> None:
    everything = between.join(str(entry) for row in rows for entry in row)
    assert _passes(rows, everything) <= _most(rows)


@given(_ROWS | _SHARED_ROWS, st.integers(0, 5), st.sampled_from([" ", ": ", ", "]))
def test_an_honest_report_passes(rows: list[list[Any]], place: int, between: str) -> None:
    row = rows[place % len(rows)]
    rule = criterion("reports", expected=rows, tolerance=0.4)
    runs = [_record_speech(between.join(map(str, row)))] * len(rows)
    result = judged(rule, *runs, poses=_places(len(rows)))
    assert result.evidence[place % len(rows)].passed, result.message


@pytest.mark.parametrize(
    ("rows", "text", "right"),
    [
        ([["rows", 7], ["rows", 9]], "rows: 7, columns: 9", {0}),
        ([["rows", 7], ["rows", 9]], "columns 7 rows of 14: 9", {1}),
        ([["rows", 7], ["rows", 9]], "rows or 7 or 9", {0}),
        ([["rows", 7], ["rows", 9]], "rows 7 9", set()),
        ([["rows", 7], ["rows", 9]], "rows 7 | rows 9", set()),
        ([["left", "red"], ["left", "blue"]], "left sees red, right sees blue", {0}),
        ([["left", "red"], ["left", "blue"]], "left: red or blue", {0}),
        ([["left", "red"], ["left", "blue"]], "left: red blue", set()),
        ([["grey"], ["dark grey"]], "dark grey", {1}),
        ([["grey"], ["dark grey"]], "grey", {0}),
        ([["grey"], ["dark grey"]], "dark grey or grey", {1}),
        ([[255, 100], [0, 0]], "raw 255 of 255, percent 100", {0}),
        ([[255, 100], [0, 0]], "255 or 100 or 0 or 0", set()),
    ],
)
def test_what_follows_a_text_belongs_to_it(rows: list[list[Any]], text: str, right: set[int]) -> None:
    result = judged(criterion("reports", expected=rows), *[_record_speech(text)] * len(rows), poses=_places(len(rows)))
    assert {place for place, evidence in enumerate(result.evidence) if evidence.passed} == right


@pytest.mark.parametrize(
    ("counts", "reported", "right"),
    [
        ([1, 3, 1, 1], [0], 1),
        ([1, 3, 1, 1], [1], 3),
        ([1, 3, 1, 1], [0, 1], 0),
        ([1, 3, 1, 1], [0, 2, 3], 3),
        ([1, 3, 1, 1], [0, 2], 2),
        ([3, 3, 1, 1, 1, 1], [0, 1], 0),
        ([3, 3, 1, 1, 1, 1], [0, 2, 3], 5),
        ([4, 1, 1], [0], 4),
        ([4, 1, 1, 1], [0, 1], 0),
    ],
)
def test_poses_that_share_a_row_are_counted_each(counts: list[int], reported: list[int], right: int) -> None:
    rows: list[list[Any]] = [["rows", 10 * place] for place, count in enumerate(counts) for _ in range(count)]
    assert _passes(rows, " ".join(f"rows {10 * place}" for place in reported)) == right


@pytest.mark.parametrize(
    ("expected", "tolerance", "warned"),
    [
        ([["grey"], ["black"], ["black"], ["grey"], ["grey"]], 0.5, "fits 3 of the 5 poses"),
        ([["grey"], ["black"], ["black"], ["grey"]], 0.5, ""),
        ([["grey"], ["grey"]], 0.5, ""),
        ([["grey"]], 0.5, ""),
        ("label", 0.5, ""),
        ([["grey"], ["dark grey"], ["dark grey"], ["black"]], 0.5, ""),
        ([[10], [11], [30]], 0.5, "fits 2 of the 3 poses"),
        ([[10], [11], [30]], 0.4, ""),
    ],
)
def test_a_row_that_fits_most_poses_is_warned_of(expected: Any, tolerance: float, warned: str) -> None:
    tested_assignment = replace(
        find_assignment("black-or-grey"), criteria=(criterion("reports", expected=expected, tolerance=tolerance),)
    )
    warnings = list(find_guessable_reports(tested_assignment))
    assert [warned in warning for warning in warnings] == [True] * bool(warned)


_BOXES = "rows or 7 or 9 or 10 or 11 columns or 7 or 9 or 11 black or 49 or 51 or 53 or 60"
_COLOURS = "100 | " + " or ".join(f"{level} or {level} or {level}" for level in (255, 220, 211, 128, 0))
_LOLLIPOP = "82.75 or 82.75 or 0 or 0 or 100 or 66.67 or 100 or 33.33"


@pytest.mark.parametrize(
    ("assignment", "text"),
    [
        ("bounding-boxes", _BOXES),
        ("bounding-boxes", "rows 11 rows 7 columns 9 black 51 black 49"),
        ("grey-band-readings", _COLOURS),
        ("calibrate-on-lollipop", _LOLLIPOP),
        ("calibrate-on-line", "255 or 100 or 0 or 0"),
    ],
)
def test_no_constant_earns_the_marks_of_the_catalogue(assignment: str, text: str) -> None:
    graded_assignment = find_assignment(assignment)
    run = recorded(printed=(TimedText(1.0, text),), messages=talk(("IMG_DATA", text)))
    trials = tuple(
        TrialResult(each.scenario.id, each.index, 1, 0.0, 0.0, "visible", run, place=each.place)
        for each in graded_assignment.trials()
    )
    kinds = {each.id: each for each in graded_assignment.criteria}
    for result in judge(graded_assignment, trials):
        if kinds[result.id].check == "reports":
            assert 2 * sum(evidence.passed for evidence in result.evidence) <= len(trials), result.id
