"""Sweeps: their trials, curves and marks, with real runs where it matters."""

from __future__ import annotations

from collections import Counter
from dataclasses import replace
from decimal import Decimal
from fractions import Fraction
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from responders.channel import Channel
from responders.source_file import SourceFile
from service.grading.grade import Level
from service.grading.grader import grade
from service.grading.judging.accuracy_curves import compute_area, compute_share_above, find_range_above
from service.grading.trial_runner import TrialRunner
from service.store.codec import decode, encode
from sim.recording import Pose
from submissions.assignment.definition import Assignment, Parts, Scenario, WorldSpec
from submissions.assignment.examples import read_example
from submissions.assignment.reader import find_assignment, read_assignment
from submissions.assignment.scenario import CONDITIONS, Sweep
from submissions.criteria.robustness import Robustness
from submissions.submission import Submission

POSES = (Pose(200, 900, 0), Pose(280, 900, 0), Pose(360, 900, 0))
SAYS_SQUARE = """
import time
def responder(text):
    time.sleep(0.2)
    return "square"
"""
SENDS_TWO = """
import time
print("IMG_DATA")
time.sleep(1)
print("IMG_DATA")
time.sleep(1)
"""


def assignment(scenario: Scenario, *criteria: Robustness) -> Assignment:
    return Assignment("a", "A", WorldSpec("Simple_Shapes"), Parts(), (scenario,), criteria)


def levels(*shares: tuple[float, int, int]) -> tuple[Level, ...]:
    return tuple(Level(at, right, n, 0, 1) for at, right, n in shares)


def test_a_sweep_varies_one_condition_at_a_time() -> None:
    channel = Channel(delay=0.1, jitter=0.3)
    sweep = Sweep(offset_x=(-2, 0), heading=(5,), light_noise=(64,), loss=(0.5,), delay=(2,))
    trials = list(assignment(Scenario("s", POSES[:1], channel=channel, sweep=sweep, trials=2)).trials())
    assert [trial.index for trial in trials] == list(range(12))
    assert Counter(trial.sweep for trial in trials) == {
        ((name, level),): 2
        for name, level in (
            ("offset_x", -2), ("offset_x", 0), ("heading", 5), ("light_noise", 64), ("loss", 0.5), ("delay", 2)
        )
    }  # fmt: skip
    seen = [(t.pose.x, t.pose.y, t.pose.heading, t.light_noise, t.channel.loss, t.channel.delay) for t in trials[::2]]
    assert seen == [
        (198, 900, 0, 0, 0, 0.1),
        (200, 900, 0, 0, 0, 0.1),
        (200, 900, 5, 0, 0, 0.1),
        (200, 900, 0, 64, 0, 0.1),
        (200, 900, 0, 0, 0.5, 0.1),
        (200, 900, 0, 0, 0, 2),
    ]
    assert all(trial.channel.jitter == 0.3 for trial in trials)


def test_every_condition_has_words_and_a_place_in_the_sweep() -> None:
    assert Sweep(**dict.fromkeys(CONDITIONS, (0.0,))).conditions == tuple(CONDITIONS)


def test_what_was_planned_before_there_were_sweeps_is_planned_alike() -> None:
    scenario = Scenario("s", POSES, light_noise=(0, 32), trials=2)
    plan = [(t.pose, t.light_noise, t.seed) for t in assignment(scenario).trials()]
    graded_assignment = assignment(scenario)
    assert plan == [
        (pose, noise, graded_assignment.seed(scenario, 4 * place + 2 * loud + again))
        for place, pose in enumerate(POSES)
        for loud, noise in enumerate((0, 32))
        for again in range(2)
    ]


def test_shuffled_poses_come_once_each_and_jitter_stays_within_its_bounds() -> None:
    poses = tuple(Pose(100.0 * number, 500, 90) for number in range(1, 13))
    scenario = Scenario("s", poses, choose="shuffled", start_jitter=(3, 0, 2))
    trials = list(assignment(scenario).trials())
    places = [trial.place for trial in trials]
    assert sorted(places) == list(range(12)) != places
    off = [(t.pose.x - poses[t.place].x, t.pose.y - 500, t.pose.heading - 90) for t in trials]
    assert len({dx for dx, _, _ in off}) == 12
    assert all(abs(dx) <= 3 and dy == 0 and abs(turn) <= 2 for dx, dy, turn in off)
    assert max(abs(dx) for dx, _, _ in off) > 1
    assert trials == list(assignment(scenario).trials())


def test_a_stored_assignment_keeps_its_sweep() -> None:
    graded_assignment = find_assignment("shapes-off-centre")
    back = decode(Assignment, encode(graded_assignment))
    assert list(back.trials()) == list(graded_assignment.trials())
    assert back.criteria == graded_assignment.criteria


def test_a_secret_decides_the_seeds_of_what_is_hidden_and_of_nothing_else(tmp_path: Path) -> None:
    text = """secret = "{}"
id = "a"
title = "A"
[[scenario]]
id = "shown"
[[scenario]]
id = "hidden"
visibility = "hidden"
[[criterion]]
title = "Ends"
marks = 1
check = "finishes"
"""
    seeds = []
    for secret in ("", "one", "two"):
        (tmp_path / "assignment.toml").write_text(text.format(secret))
        seeds.append([trial.seed for trial in read_assignment(tmp_path).trials()])
    assert len({each for each, _ in seeds}) == 1
    assert len({hidden for _, hidden in seeds}) == 3


@pytest.mark.parametrize(
    ("shares", "mean", "part", "ends"),
    [
        ([(0, 4, 4), (10, 4, 4), (20, 4, 4)], Fraction(1), Fraction(1), (0, 20)),
        ([(0, 4, 4), (10, 2, 4), (20, 0, 4)], Fraction(1, 2), Fraction(0), (0, 0)),
        ([(0, 4, 4), (10, 4, 4), (40, 0, 4)], Fraction(5, 8), Fraction(1, 4), (0, 10)),
        ([(-2, 0, 4), (-1, 4, 4), (0, 4, 4), (1, 4, 4), (2, 0, 4)], Fraction(3, 4), Fraction(1, 2), (-1, 1)),
        ([(-2, 4, 4), (-1, 0, 4), (0, 4, 4), (1, 0, 4), (2, 4, 4)], Fraction(1, 2), Fraction(0), (0, 0)),
        ([(0, 1, 4), (1, 4, 4)], Fraction(5, 8), Fraction(0), None),
        ([(0, 3, 4)], Fraction(3, 4), Fraction(0), None),
        ([(0.1, 4, 4)], Fraction(1), Fraction(1), (0.1, 0.1)),
        ([], Fraction(0), Fraction(0), None),
    ],
)
def test_area_and_range_of_a_curve(
    shares: list[tuple[float, int, int]], mean: Fraction, part: Fraction, ends: tuple[float, float] | None
) -> None:
    curve = levels(*shares)
    held = find_range_above(curve, 0.8)
    assert (compute_area(curve), compute_share_above(curve, 0.8)) == (mean, part)
    assert (None if held is None else (held[0].at, held[1].at)) == ends


@given(
    st.lists(
        st.tuples(st.integers(-50, 50), st.integers(0, 5)), min_size=1, max_size=8, unique_by=lambda pair: pair[0]
    ),
    st.data(),
    st.sampled_from([0.2, 0.5, 0.8, 1.0]),
)
def test_a_better_level_never_costs_marks(pairs: list[tuple[int, int]], data: st.DataObject, level: float) -> None:
    pairs.sort()
    better = data.draw(st.integers(0, len(pairs) - 1))
    before = levels(*((at, right, 6) for at, right in pairs))
    after = levels(*((at, right + (place == better), 6) for place, (at, right) in enumerate(pairs)))
    assert 0 <= compute_area(before) <= compute_area(after) <= 1
    assert 0 <= compute_share_above(before, level) <= compute_share_above(after, level) <= 1


def test_delay_loss_and_offset_are_felt(runner: TrialRunner) -> None:
    """Two images over a square, a second apart, count as one; the answer \"square\" comes 0.2 s after each."""
    sweep = Sweep(offset_x=(0, 80), loss=(0, 1), delay=(0.1, 0.9, 3))
    base = {"marks": Decimal(6), "late": "wrong", "check": "robustness"}
    wanted = tuple(
        Robustness.model_validate({**base, "id": along.replace("_", "-"), "title": along, "along": along, **more})
        for along, more in (
            ("offset_x", {}),
            ("loss", {}),
            ("delay", {"marks_from": "falls_below", "level": 1.0}),
        )
    )
    graded_assignment = assignment(Scenario("s", POSES[:1], sweep=sweep, seconds=5), *wanted)
    submission = Submission("s", SourceFile("robot.py", SENDS_TWO), SourceFile("responder.py", SAYS_SQUARE))
    result = grade(submission, graded_assignment, runner=runner)
    curves = {
        each.id: [(level.at, level.right, level.n) for level in each.curves[0].levels] for each in result.criteria
    }
    assert curves == {
        "offset-x": [(0, 1, 1), (80, 0, 1)],
        "loss": [(0, 1, 1), (1, 0, 1)],
        "delay": [(0.1, 1, 1), (0.9, 0, 1), (3, 0, 1)],
    }
    assert [each.marks for each in result.criteria] == [3, 3, 0]
    assert "By message delay (s): 1.00 at 0.1, 0.00 at 0.9, 0.00 at 3." in result.criteria[2].message
    assert "2 answered, 4 late" in result.criteria[2].message
    again = grade(submission, graded_assignment, runner=runner)
    assert [t.recording.sha256 for t in again.trials] == [t.recording.sha256 for t in result.trials]


@pytest.mark.long
def test_cheats_gain_where_nothing_forbids_them_and_nothing_where_it_does(runner: TrialRunner) -> None:
    """The marks of the catalogue's cheats on the course's own floor, with its patches, and on the shuffled one."""
    forbidding = find_assignment("shapes-on-the-move")
    allowing = replace(forbidding, world=replace(forbidding.world, background="Simple_Shapes", labels=True, sheet=0))
    got = {}
    for name in ("by-the-way-driven", "counts-the-messages", "echoes-the-patch"):
        submission = read_example("shapes-on-the-move", name)
        results = [grade(submission, each, runner=runner).criteria for each in (allowing, forbidding)]
        got[name] = [next(result.marks for result in criteria if result.id == "shapes") for criteria in results]
    assert got == {"by-the-way-driven": [9, 0], "counts-the-messages": [9, 0], "echoes-the-patch": [9, 0]}
