"""Resubmissions of one program meet the same trials of a pool, so white space gains nothing."""

from __future__ import annotations

from pathlib import Path

import pytest

from pools import LUCKY, pool_assignment, pool_request
from service.grading.grade import Grade
from service.grading.grader import grade
from service.grading.pools.drawing import PoolExtent
from service.grading.trial_runner import TrialRunner
from submissions.assignment.definition import Assignment

COUNT = 20
#: Drives with one of two speeds by its own chance.
RANDOM = LUCKY.replace("SpeedPercent(50), SpeedPercent(50)", "*[SpeedPercent(choice([45, 55]))] * 2").replace(
    "tank =", "from random import choice\ntank ="
)


@pytest.fixture
def assignment(tmp_path: Path) -> Assignment:
    return pool_assignment(tmp_path / "short-pool")


def grade_program(assignment: Assignment, program: str, runner: TrialRunner) -> Grade:
    submission = pool_request(assignment, program=program).submission
    return grade(submission, assignment, runner=runner, extent=PoolExtent.UNTIL_DECIDED)


def list_variants(program: str) -> list[str]:
    """Return the program with different white space: blank lines, and blanks at the ends of lines."""
    lines = program.splitlines()
    variants = []
    for number in range(COUNT):
        blanks, empty_lines = " " * (number % 5), "\n" * (number // 5)
        variants.append(empty_lines + "\n".join(f"{line}{blanks}" for line in lines) + "\n")
    return variants


@pytest.mark.long
def test_best_of_twenty_variants_in_white_space_is_as_good_as_one(assignment: Assignment, runner: TrialRunner) -> None:
    variants = list_variants(LUCKY)
    submissions = {pool_request(assignment, program=each).submission.sha256 for each in variants}
    assert len(submissions) == COUNT
    grades = [grade_program(assignment, each, runner) for each in variants]
    assert grades[0].is_provisional
    assert max(each.marks for each in grades) == grades[0].marks
    assert {each.criteria[0].pool for each in grades} == {grades[0].criteria[0].pool}
    assert {_list_trials(each) for each in grades} == {_list_trials(grades[0])}
    assert {_list_hashes(each) for each in grades} == {_list_hashes(grades[0])}


def test_random_numbers_of_a_program_differ_and_its_trials_do_not(assignment: Assignment, runner: TrialRunner) -> None:
    first, *others = (grade_program(assignment, each, runner) for each in list_variants(RANDOM)[:6])
    assert any(_list_hashes(each) != _list_hashes(first) for each in others)
    for each in others:
        # A longer grading begins with the trials of a shorter one.
        common = min(len(each.trials), len(first.trials))
        assert _list_trials(each)[:common] == _list_trials(first)[:common]


def _list_trials(graded: Grade) -> tuple[tuple[int, int, int], ...]:
    """Return the numbers, the seeds and the places of the trials, which the secret decides."""
    return tuple((trial.index, trial.seed, trial.place) for trial in graded.trials)


def _list_hashes(graded: Grade) -> tuple[str, ...]:
    return tuple(trial.recording.sha256 for trial in graded.trials)
