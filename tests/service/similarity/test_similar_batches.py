"""Whole graded batches: copies are found in every rewritten form, and honest students form no pair."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from functools import cache

import pytest

from responders.source_file import SourceFile
from service.grading.grade import TrialResult
from service.grading.grader import grade
from service.grading.trial_runner import TrialRunner
from service.reports.similarity import describe_similarity
from service.similarity.behaviour import extract_behaviour
from service.similarity.pairs import Similarity, compare_submissions
from service.similarity.similar_sources import build_source
from service.similarity.sources import collect_given_code
from service.similarity.tokens import tokenise_source
from submissions.assignment.reader import find_assignment
from submissions.submission import Submission

_WHOLE = find_assignment("single-sensor-edge-follower")
#: A third of its time is enough to tell the paths apart.
ASSIGNMENT = replace(
    _WHOLE, scenarios=tuple(replace(scenario, seconds=scenario.seconds / 3) for scenario in _WHOLE.scenarios)
)
EDGE_FOLLOWER = """
%%sim_magic_preloaded -b Line_Following_Test -x 141 -y 125 -a 90
SPEED = {speed}
GAIN = {gain}
EDGE = {edge}

while True:
    light = colorLeft.reflected_light_intensity_pc
    steering = GAIN * (light - EDGE)
    tank_drive.on(SpeedPercent(SPEED + steering), SpeedPercent(SPEED - steering))
"""
#: The same sums in another order, with brackets, as a sum of a list, and with a pair instead of two variables.
WRAPPED = """
%%sim_magic_preloaded -b Line_Following_Test -x 141 -y 125 -a 90
v, k, middle = 17, 0.37, 46

while True:
    brightness = (colorLeft.reflected_light_intensity_pc)
    both = ((brightness - middle) * k), v
    tank_drive.on(SpeedPercent(sum([both[1], both[0]])), SpeedPercent((-both[0]) + (both[1])))
"""
#: One way to drive a square, in three spellings.
SQUARES = (
    "for side in range(4):\n    tank_drive.on_for_rotations(20, 20, 1)\n    tank_drive.on_for_degrees(-15, 15, 180)\n",
    "side = 0\nwhile side < 4:\n    tank_drive.on_for_rotations(20, 20, 1)\n    side += 1\n"
    "    tank_drive.on_for_degrees(-15, 15, 180)\n",
    "def turn():\n    tank_drive.on_for_degrees(-15, 15, 180)\n\n"
    + "tank_drive.on_for_rotations(20, 20, 1)\nturn()\n" * 4,
)


def _edge_followers(number: int) -> dict[str, str]:
    """Return students with an individual speed, gain and edge for the lecture's follower."""
    return {
        f"s{each:02}": EDGE_FOLLOWER.format(speed=10 + each % 7, gain=0.3 + each / 100, edge=42 + each)
        for each in range(number)
    }


@cache
def _trials(program: str, runner: TrialRunner) -> tuple[TrialResult, ...]:
    return grade(Submission("student", SourceFile("robot.py", program.lstrip())), ASSIGNMENT, runner=runner).trials


def _compared(programs: Mapping[str, str], runner: TrialRunner, trials: int) -> Similarity:
    behaviours = {student: extract_behaviour(_trials(text, runner)[:trials]) for student, text in programs.items()}
    sources = [build_source(student, "robot.py", program) for student, program in programs.items()]
    return compare_submissions(ASSIGNMENT.id, sources, collect_given_code(ASSIGNMENT), behaviours)


@pytest.mark.long
@pytest.mark.parametrize("trials", [1, 2])
def test_a_copy_that_was_rewritten_is_found_by_its_path_and_its_recordings(runner: TrialRunner, trials: int) -> None:
    original = EDGE_FOLLOWER.format(speed=17, gain=0.37, edge=46)
    similarity = _compared({**_edge_followers(8), "ada": original, "eva": WRAPPED}, runner, trials)
    assert [pair.students for pair in similarity.pairs] == [("ada", "eva")]
    assert similarity.same_recordings == (("ada", "eva"),)


@pytest.mark.long
@pytest.mark.parametrize("trials", [1, 2])
def test_students_who_use_the_follower_of_the_lecture_are_no_pair(runner: TrialRunner, trials: int) -> None:
    lecture = EDGE_FOLLOWER.format(speed=14, gain=0.4, edge=50)
    similarity = _compared({**_edge_followers(8), **dict.fromkeys(("ada", "bob", "cyd"), lecture)}, runner, trials)
    assert similarity.pairs == ()
    # A fact that is listed with its number of students.
    assert similarity.same_recordings == (("ada", "bob", "cyd"),)


@pytest.mark.parametrize("others", [0, 8])
def test_one_way_in_three_spellings_is_no_pair(runner: TrialRunner, others: int) -> None:
    squares = {f"square-{number}": f"%%sim_magic_preloaded\n{text}" for number, text in enumerate(SQUARES)}
    similarity = _compared({**_edge_followers(others), **squares}, runner, 1)
    assert similarity.pairs == ()
    assert similarity.same == ()
    assert similarity.same_recordings == (tuple(squares),)
    assert "no pairs" not in describe_similarity(similarity)
    assert "1 group with a common file or common recordings" in describe_similarity(similarity)


@pytest.mark.parametrize(
    ("one", "other"),
    [
        ("x = a + b * 2", "x = 2 * b + a"),
        ("x = (a + b)", "x = b + a"),
        ("x = -a + b", "x = b - a"),
        ("if a > 3 and b.ready:\n    stop()", "if b.ready and (3 < a):\n    stop()"),
        ("if a == f(b):\n    stop()", "if f(b) == a:\n    stop()"),
        ("go(x=(a + b), y=1)", "go(x=b + a, y=1)"),
        ("return sum([a.left, b])", "return b + a.left"),
        ("x = a | b & c", "x = (c & b) | a"),
        ("x = a / b * c", "x = c * a / b"),
        ("def go(pair):\n    drive(pair[0], pair[1])", "def go(x):\n    drive(x, x)"),
    ],
)
def test_order_of_operands_and_brackets_do_not_count(one: str, other: str) -> None:
    assert tokenise_source(one).numbers.tolist() == tokenise_source(other).numbers.tolist()


@pytest.mark.parametrize(
    ("one", "other"),
    [
        ("x = a - f(b)", "x = f(b) - a"),
        ("x = a / f(b)", "x = f(b) / a"),
        ("x = f(a + b)", "x = f(a) + b"),
        ("x = 'no' + f(a)", "x = f(a) + 'no'"),
        ("if f(a) < b: stop()", "if f(a) > b: stop()"),
        ("x = f(a) % b", "x = b % f(a)"),
        ("x = a[f(b)]", "x = a"),
    ],
)
def test_other_sums_are_other_tokens(one: str, other: str) -> None:
    assert tokenise_source(one).numbers.tolist() != tokenise_source(other).numbers.tolist()
