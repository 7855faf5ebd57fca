"""Pools in assignments: their trials, their order, and what is wrong with a pool."""

from __future__ import annotations

from pathlib import Path

import pytest

from pools import ASSIGNMENT, pool_assignment
from service.store.courses.assignment_versions import assignment_from_bytes, assignment_to_bytes
from sim.errors import UsageError
from submissions.seeds import Secret


def test_the_order_of_a_pool_depends_on_the_secret_and_its_trials_on_their_numbers(tmp_path: Path) -> None:
    assignment = pool_assignment(tmp_path / "pool")
    first, second = (list(assignment.trials(Secret(text))) for text in ("one", "two"))
    assert sorted(trial.index for trial in first) == list(range(30))
    assert [trial.index for trial in first] != sorted(trial.index for trial in first)
    assert [trial.index for trial in first] != [trial.index for trial in second]
    assert first == list(assignment.trials(Secret("one")))
    assert len({trial.seed for trial in first}) == 30
    assert assignment.trial_count == 30


def test_a_stored_assignment_keeps_its_pool(tmp_path: Path) -> None:
    assignment = pool_assignment(tmp_path / "pool")
    stored = assignment_from_bytes(assignment_to_bytes(assignment))
    assert stored.scenarios == assignment.scenarios
    assert [each.id for each in stored.chance_criteria] == ["far"]


@pytest.mark.parametrize(
    ("before", "after", "message"),
    [
        ("pool = 30\n", "", "trials has least and most, which need a pool"),
        ("pool = 30\n", "pool = 1\n", "pool is 1, expected"),
        ("pool = 30\n", "pool = 5\n", "least 2 and most 6, expected least <= most <= pool (5)"),
        ("trials = { least = 2, most = 6 }", "trials = 6", "trials is a number, but there is a pool"),
        ("trials = { least = 2, most = 6 }", "trials = { least = 2, all = 6 }", '"all" is not a key'),
        ("[[500, 500, 0]]", "[[500, 500, 0], [600, 500, 0]]", 'choose is not "random", but there are several poses'),
        ("motor_noise = 400", "motor_noise = [0, 400]", "motor_noise has several levels"),
        ("[[criterion]]", "[scenario.sweep]\nloss = [0, 0.5]\n[[criterion]]", "sweep has levels"),
        ("bands = [[0.5, 2], [0.7, 4]]", 'over = "all"\nbands = [[0.7, 4]]', 'bands is not used with over = "all"'),
        ("bands = [[0.5, 2], [0.7, 4]]", "bands = [[0.7, 2], [0.5, 4]]", "bands does not ascend"),
        ("bands = [[0.5, 2], [0.7, 4]]", "bands = [[0.5, 2], [0.7, 3]]", "bands ends with 3 marks, expected 4"),
        ("pool = 30\ntrials = { least = 2, most = 6 }\n", "trials = 6\n", "bands needs a pool"),
        (
            'check = "displacement"\ndistance = [75, 1000]\nbands = [[0.5, 2], [0.7, 4]]',
            'check = "classification"',
            "compares trials or criteria",
        ),
        (
            "[[criterion]]",
            '[[scenario]]\nid = "calm"\nposes = [[500, 500, 0]]\n[[criterion]]',
            "scenarios has 2 scenarios, one of them with a pool",
        ),
    ],
)
def test_mistakes_in_a_pool_are_reported(tmp_path: Path, before: str, after: str, message: str) -> None:
    assert before in ASSIGNMENT
    with pytest.raises(UsageError) as raised:
        pool_assignment(tmp_path / "pool", ASSIGNMENT.replace(before, after))
    assert message in str(raised.value)


def test_the_maximum_defaults_to_the_size_of_a_small_pool(tmp_path: Path) -> None:
    text = ASSIGNMENT.replace("trials = { least = 2, most = 6 }\n", "").replace("pool = 30", "pool = 10")
    (scenario,) = pool_assignment(tmp_path / "pool", text).scenarios
    assert scenario.draw is not None
    assert (scenario.draw.least, scenario.draw.most) == (4, 10)
