"""Judging whether two series of a recording are related, with runs made by hand and one simulated run."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from pydantic import ValidationError

from driving import driven, measured, passes, rest, spin, straight
from judging import criterion, judged
from service.grading.grader import grade
from service.grading.trial_runner import TrialRunner
from sim.recording import Recording
from submissions.assignment.examples import locate_examples
from submissions.assignment.reader import find_assignment
from submissions.bundle import read_submission

pytestmark = pytest.mark.fast

NEARER = {"of": "speed", "to": "ultrasonic", "changes": 50}


def towards(*moves: Any) -> Recording:
    """Return a run towards a post 1000 mm from the start, with the distance read by the ultrasonic sensor."""
    run = driven(*moves)
    return replace(run, ticks=replace(run.ticks, ultrasonic=np.abs(1100 - run.ticks.x)))


@pytest.mark.parametrize(
    ("moves", "keys", "good"),
    [
        ([straight(60, speed) for speed in (6, 5, 4, 3, 2, 1)], {}, True),
        ([straight(60, 6), straight(60, 2)], {}, True),
        ([straight(60, 6), rest(60), straight(60, 2), rest(60)], {}, True),
        ([straight(60, speed) for speed in (1, 2, 3, 4, 5, 6)], {}, False),
        ([straight(60, speed) for speed in (1, 2, 3, 4, 5, 6)], {"goes": "against"}, True),
        ([straight(120, 4)], {}, False),
        ([straight(60, 3), straight(60, 2)], {}, False),  # too little, by 30 mm/s
        ([straight(60, 3), straight(60, 2)], {"changes": 20}, True),
        ([straight(60, 6), straight(60, 2), straight(60, 6)], {}, False),
        ([spin(90)], {}, False),
        ([], {}, False),
    ],
)
def test_slower_when_nearer(moves: Any, keys: dict[str, Any], good: bool) -> None:
    assert passes(criterion("relation", **(NEARER | keys)), towards(*moves)) is good


@pytest.mark.parametrize(
    ("of", "to", "goes"),
    [
        ("x", "time", "with"),
        ("ultrasonic", "x", "against"),
        ("left wheel speed", "speed", "with"),
        ("left light", "time", "against"),
        ("speed", "time", "with"),
    ],
)
def test_series_that_go_with_each_other(of: str, to: str, goes: str) -> None:
    run = towards(straight(60, 2), straight(60, 4), straight(60, 6))
    darker = np.linspace(255 * 305, 0, len(run.ticks)).astype(np.int64)
    run = replace(run, ticks=replace(run.ticks, left_sums=np.column_stack([darker] * 3)))
    relation = {"of": of, "to": to, "goes": goes}
    assert passes(criterion("relation", **relation), run)
    assert not passes(criterion("relation", **(relation | {"goes": {"with": "against", "against": "with"}[goes]})), run)


def test_the_share_of_pairs_is_told_and_counts() -> None:
    run = towards(straight(60, 2), straight(60, 6), straight(60, 2))
    result = judged(criterion("relation", over="mean", **NEARER), run)
    share = measured(result, "share of pairs")
    assert 0 < share < 0.9
    assert float(result.marks) == pytest.approx(4 * share / 0.9, abs=0.01)
    assert f"this was true for {share:.0%}; it was from 60 to 180 while the robot moved" in result.message


def test_one_series_alone_is_no_relation() -> None:
    with pytest.raises(ValidationError, match="the same series in of and to"):
        criterion("relation", of="speed", to="speed")


@pytest.mark.parametrize(("example", "good"), [("reference", True), ("stops-too-early", False)])
def test_a_robot_that_slows_down_at_the_post_needs_no_check_in_python(
    example: str, good: bool, runner: TrialRunner
) -> None:
    post = find_assignment("ultrasonic-stop")
    rule = criterion("relation", scenarios=["at-the-post"], **NEARER)
    slower = replace(post, criteria=(rule,))
    graded = grade(
        read_submission(locate_examples(post.id) / example, required_parts=post.parts), slower, runner=runner
    )
    assert (graded.marks == 4) is good, graded.criteria[0].message
