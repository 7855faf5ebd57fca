"""Judging two robots: their distance from each other, and each robot alone."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import pytest

from driving import driven, measured, passes, rest, straight
from judging import criterion, judged
from sim.recording import Fault, Pose, Recording, TimedText, Verdict

HERE, THERE = Pose(100, 500, 0), Pose(1100, 500, 180)


def both(first: Recording, second: Recording) -> Recording:
    return replace(first, partner=second)


#: 1000 mm apart; 600 after 2 s; 200 after 4 s, when the second one's program has ended; 100 after 5 s.
MEET = both(driven(straight(200, 200 / 60), straight(200, 200 / 60), straight(100, 100 / 30), start=HERE),
            driven(straight(200, 200 / 60), straight(200, 200 / 60), start=THERE))  # fmt: skip


@pytest.mark.parametrize(
    ("keys", "fits"),
    [
        ({"at_most": 100.1}, True),
        ({"at_most": 99}, False),
        ({"at_least": 99}, True),
        ({"at_least": 101}, False),
        ({"at_most": 101, "when": "once"}, True),
        ({"at_least": 900, "when": "once"}, True),
        ({"at_least": 900, "when": "once", "after": 2}, False),
        ({"at_least": 99, "when": "always"}, True),
        ({"at_most": 500, "when": "always", "after": 3}, True),
        ({"at_most": 500, "when": "always", "after": 2}, False),
        ({"at_most": 500, "when": "always", "after": 2, "share": 0.8}, True),
        ({"at_most": 500, "when": "always", "after": 2, "share": 0.9}, False),
    ],
)
def test_apart(keys: dict[str, Any], fits: bool) -> None:
    assert passes(criterion("apart", **keys), MEET) is fits


def test_what_was_measured_and_told() -> None:
    result = judged(criterion("apart", at_most=300, when="always", over="mean"), MEET)
    assert measured(result, "apart at the end") == pytest.approx(100)
    assert measured(result, "least apart") == pytest.approx(100)
    assert measured(result, "most apart") == pytest.approx(1000)
    assert "within 300 mm of each other for all of the time" in result.message
    assert 0 < result.marks < 2


def test_a_run_of_one_robot_is_not_together() -> None:
    assert not passes(criterion("apart", at_most=5000), driven(rest(30)))


def test_robots_without_a_tick_stand_where_they_start() -> None:
    stood = both(driven(start=HERE), driven(start=THERE))
    assert passes(criterion("apart", at_least=1000, at_most=1000), stood)


@pytest.mark.parametrize(("robot", "x"), [(1, 600), (2, 700)])
def test_a_criterion_looks_at_the_robot_that_it_names(robot: int, x: float) -> None:
    assert passes(criterion("pose", x=x, y=500, robot=robot), MEET)
    assert not passes(criterion("pose", x=x, y=500, robot=3 - robot), MEET)


def test_what_one_says_or_does_wrong_is_not_the_others() -> None:
    crashed = replace(
        driven(rest(), start=THERE),
        spoken=(TimedText(0.1, "ouch"),),
        faults=(Fault(0.1, Verdict.PROGRAM_ERROR, "second program", "ZeroDivisionError: division by zero", 1),),
        verdict=Verdict.PROGRAM_ERROR,
    )
    recording = both(driven(straight(100), start=HERE), crashed)
    for robot, ends in ((1, True), (2, False)):
        assert passes(criterion("finishes", robot=robot), recording) is ends
        assert passes(criterion("says", equals="ouch", robot=robot), recording) is not ends
