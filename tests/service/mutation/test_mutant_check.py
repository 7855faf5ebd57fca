"""Grading of mutants: faults that lose marks are killed, equal behaviour is equivalent, the others survive."""

from __future__ import annotations

import json
import re
import shutil
from pathlib import Path

import pytest

from command import robomark
from service.commands.mutant_tables import build_catalogue_mutant_tables, build_mutant_tables
from service.commands.output import print_renderables
from service.grading.trial_runner import TrialRunner
from service.mutation.mutant_check import MutantCheck, check_mutants

_PROGRAM = """%%sim_magic_preloaded
import random
TURNS = 1  # never used: equivalent
tank_drive.on_for_rotations(SpeedPercent(40), SpeedPercent(40), 2)
say("Hello " + str(random.random()))
"""


@pytest.fixture(scope="module")
def assignment(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a copy of an assignment that marks only the distance, with a reference that uses random numbers."""
    folder = tmp_path_factory.mktemp("assignments") / "drive"
    folder.mkdir()
    (folder / "assignment.toml").write_text(
        """id = "drive"
title = "Drive"
[parts]
responder = "none"
[[scenario]]
id = "start"
poses = [[300, 500, 0], [400, 600, 0]]
seconds = 10
[[criterion]]
title = "Drives"
marks = 2
check = "displacement"
forward = [100, 2000]
"""
    )
    reference = folder / "examples" / "reference"
    reference.mkdir(parents=True)
    (reference / "robot.py").write_text(_PROGRAM)
    return folder


@pytest.fixture(scope="module")
def check(assignment: Path, runner: TrialRunner) -> MutantCheck:
    return check_mutants(str(assignment), 30, runner=runner)


def test_each_mutant_gets_its_fate(check: MutantCheck) -> None:
    fates = {(each.mutant.line, each.mutant.old, each.mutant.new): each.fate for each in check.results}
    assert fates[3, "1", "2"] == "equivalent"
    assert fates[4, "2", "3"] == "survivor"
    assert fates[4, "on_for_rotations", "on_for_degrees"] == "killed"
    assert fates[5, 'say("Hello " + str(random.random()))', "pass"] == "survivor"


def test_the_numbers_of_the_operators_add_up(check: MutantCheck) -> None:
    assert check.total.mutants == len(check.results) == sum(each.mutants for each in check.counts)
    for counts in (*check.counts, check.total):
        assert counts.mutants == counts.equivalent + counts.killed + counts.survivors
    assert len(check.survivors) == check.total.survivors


def test_a_notebook_as_reference_is_reported(assignment: Path, tmp_path: Path, runner: TrialRunner) -> None:
    folder = tmp_path / "drive"
    shutil.copytree(assignment, folder)
    shutil.rmtree(folder / "examples")
    assert "no examples" in check_mutants(str(folder), 5, runner=runner).problem


def test_the_tables_list_the_survivors(check: MutantCheck, capsys: pytest.CaptureFixture[str]) -> None:
    print_renderables(*build_mutant_tables(check))
    assert re.search(r"wrong unit +1 +0 +1 +0\n", capsys.readouterr().out)
    print_renderables(*build_catalogue_mutant_tables([check]))
    assert re.search(r"drive +robot.py +4 +larger number +2 -> 3\n", capsys.readouterr().out)


def test_the_command_grades_as_many_as_it_may(assignment: Path) -> None:
    ended = robomark("assignments", "check", str(assignment), "--mutants", "3", "--json")
    [checked] = json.loads(ended.stdout)["assignments"]
    assert sum(each["mutants"] for each in checked["mutants"]["operators"]) == 3
    assert {"operators", "survivors", "ungraded", "problem"} == set(checked["mutants"])
