"""Mistakes in the tables of criteria about motion and paths are reported with the expected value."""

from __future__ import annotations

from importlib import import_module
from typing import Any

import pytest

from service.grading.judging.judge import JUDGES
from submissions.assignment.table_problems import TableProblem, read_table
from submissions.criteria import SCHEMAS

pytestmark = pytest.mark.fast

AREA = {"rectangle": [0, 0, 10, 10]}


@pytest.mark.parametrize(
    ("check", "keys", "place", "sentence"),
    [
        ("moves", {"moves": [{"foward": [1, 2]}]}, ("moves", 0, "foward"), 'did you mean "forward"?'),
        ("moves", {"moves": [{"name": "a turn"}]}, ("moves", 0), "moves[0] has no condition, expected one of forward"),
        ("moves", {"moves": []}, ("moves",), "moves has too few entries, expected at least 1"),
        ("moves", {"moves": [{"turn": [90]}]}, ("moves", 0, "turn"), "too few numbers, expected [least, most]"),
        ("moves", {"moves": [{"turn": [95, 85]}]}, ("moves", 0, "turn"), "an empty range"),
        ("displacement", {}, (), "has no condition, expected one of forward"),
        ("displacement", {"forward": "far"}, ("forward",), 'forward is "far", expected a list'),
        ("excursions", {"heights": [1, -1]}, ("heights",), "expected proportions like [1, 2, 1]"),
        ("encounters", {}, (), "below is missing"),
        ("encounters", {"below": 40, "then": ["jump"]}, ("then", 0), 'expected "reverse", "turn" or "stop"'),
        ("drawing", {"legs": 4, "figures": 2, "sizes": [[1, 2]]}, ("sizes",), "has 1 sizes for 2 figures"),
        ("visits", {"places": [AREA], "at_least": 2}, ("at_least",), "has at_least = 2 of 1 places"),
        ("visits", {"places": [{"rectangel": [0, 0, 1, 1]}]}, ("places", 0, "rectangel"), 'did you mean "rectangle"?'),
        ("visits", {"places": [{"circle": [0, 0]}]}, ("places", 0, "circle"), "expected [x, y, radius]"),
        ("keeps_out", {"areas": [AREA], "of": "nose"}, ("of",), 'expected "robot", "pen"'),
        ("closest", {"x": 1, "y": 2}, (), "has no condition, expected one of distance"),
        (
            "circuits",
            {"x": 1, "y": 2, "times": [0.5, 1], "gyro": [330, 390]},
            ("gyro",),
            "expected times to begin at 1",
        ),
        ("follows", {"line": {"on": "Loop"}}, ("line", "on"), 'expected one of "Line_Following_Test/141"'),
        ("follows", {"line": {"on": "Thruxton_Circuit"}, "at_most": 10}, ("at_most",), "expected at_most >= within"),
        (
            "laps",
            {"line": {"points": [[0, 0], [1, 1]]}, "start_line": [0, 0, 1, 1]},
            ("line",),
            "expected a closed one (closed = true)",
        ),
        ("pose", {"areas": [{"bar": [0, 0, 1, 1]}]}, ("areas", 0, "bar"), "expected [x1, y1, x2, y2, radius]"),
        ("pose", {}, (), "expected x and y, heading, zone, areas or since"),
    ],
)
def test_a_mistake_is_named_where_it_is(
    check: str, keys: dict[str, Any], place: tuple[str | int, ...], sentence: str
) -> None:
    criterion = read_table(SCHEMAS[check], {"title": "A", "marks": 1, "check": check, **keys})
    assert isinstance(criterion, list)
    (problem,) = criterion
    assert problem.path == place
    assert sentence in problem.sentence


@pytest.mark.parametrize("check", sorted(SCHEMAS))
def test_a_criterion_is_judged_in_the_module_that_is_named_like_its_schemas(check: str) -> None:
    family = SCHEMAS[check].__module__.rpartition(".")[2]
    assert JUDGES[SCHEMAS[check]] in vars(import_module(f"service.grading.judging.{family}")).values()


def test_too_few_numbers_are_told_as_their_own_kind_has_them() -> None:
    keys = {"of": "lap", "measure": "best lap", "steps": [[40]]}
    (problem,) = read_table(SCHEMAS["ranking"], {"title": "A", "marks": 1, "check": "ranking", **keys})
    assert isinstance(problem, TableProblem)
    assert problem.sentence == "steps[0] has too few numbers, expected [figure, share]"
