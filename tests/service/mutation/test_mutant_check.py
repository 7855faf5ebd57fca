"""Grading of mutants: faults that lose marks are killed, equal behaviour is equivalent, the others survive."""

from __future__ import annotations

import json
import re
import shutil
from dataclasses import replace
from pathlib import Path

import pytest

from command import robomark
from service.commands.mutant_tables import build_catalogue_mutant_tables, build_mutant_tables
from service.commands.output import print_renderables
from service.grading.trial_runner import TrialRunner
from service.mutation.mutant_check import MutantCheck, check_mutants, iterate_reference_mutants
from service.mutation.survivor_reasons import read_survivor_reasons
from submissions.assignment.examples import read_example
from submissions.assignment.export import export_for_grading
from submissions.assignment.folder import REFERENCE, list_catalogue_ids
from submissions.assignment.problems import AssignmentProblems
from submissions.assignment.reader import find_assignment

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
        assert counts.unexplained == counts.survivors
    assert len(check.survivors) == check.total.survivors


_DRIVE = "tank_drive.on_for_rotations(SpeedPercent(40), SpeedPercent(40), 2)"
_REASONS = f"""
[[survivor]]
operators = ["larger number"]
source = "{_DRIVE}"
old = "2"
reason = "The robot may drive farther."

[[survivor]]
operators = ["wrong unit"]
reason = "The robot may drive less far."

[[survivor]]
source = "  {_DRIVE}"
reason = "The line has another indentation."

[[survivor]]
old = "40"
reason = "The robot may drive at any speed."
"""


@pytest.fixture(scope="module")
def explained_assignment(assignment: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a copy of the assignment with reasons for some survivors, and with reasons that cover none."""
    folder = tmp_path_factory.mktemp("explained") / "drive"
    shutil.copytree(assignment, folder)
    (folder / "survivors.toml").write_text(_REASONS)
    return folder


def test_survivors_are_explained_by_the_reasons_of_the_author(
    check: MutantCheck, explained_assignment: Path, runner: TrialRunner, capsys: pytest.CaptureFixture[str]
) -> None:
    explained = check_mutants(str(explained_assignment), 30, runner=runner)
    assert [replace(each, reason="") for each in explained.results] == list(check.results)
    reasons = {(each.mutant.old, each.mutant.new): each.reason for each in explained.survivors}
    assert reasons["2", "3"] == "The robot may drive farther."
    assert reasons['say("Hello " + str(random.random()))', "pass"] == ""
    assert explained.total.unexplained == list(reasons.values()).count("") < check.total.unexplained
    assert explained.unexplained_share < check.unexplained_share
    stale = [each.reason for each in explained.stale_reasons]
    assert stale[:2] == ["The robot may drive less far.", "The line has another indentation."]

    print_renderables(*build_mutant_tables(explained))
    output = capsys.readouterr().out
    assert re.search(r"robot.py +4 +2 -> 3 +The robot may drive farther.\n", output)
    assert not re.search(r"larger number +2 -> 3\n", output)


def test_reasons_for_mutants_that_were_not_graded_are_not_stale(
    explained_assignment: Path, runner: TrialRunner
) -> None:
    few = check_mutants(str(explained_assignment), 1, runner=runner)
    never_right = {"The robot may drive less far.", "The line has another indentation."}
    assert {each.reason for each in few.stale_reasons} <= never_right
    assert "The line has another indentation." in {each.reason for each in few.stale_reasons}


def test_reasons_change_no_version_and_are_not_exported_for_grading(
    assignment: Path, explained_assignment: Path, tmp_path: Path
) -> None:
    assert find_assignment(explained_assignment).version == find_assignment(assignment).version
    export_for_grading(str(explained_assignment), tmp_path / "exported")
    assert not (tmp_path / "exported" / "survivors.toml").exists()


@pytest.mark.long
def test_the_command_reports_reasons_and_the_share_of_unexplained_survivors(explained_assignment: Path) -> None:
    ended = robomark("assignments", "check", str(explained_assignment), "--mutants", "10", "--json")
    mutants = json.loads(ended.stdout)["assignments"][0]["mutants"]
    assert "The robot may drive at any speed." in {each["reason"] for each in mutants["survivors"]}
    assert mutants["stale_reasons"][0] == "The robot may drive less far."
    assert mutants["unexplained_share"] > 0.1
    assert "keep full marks without a reason, expected at most 10%" in " ".join(ended.stderr.split())
    assert "a reason without a survivor: The robot may drive less far." in " ".join(ended.stderr.split())


@pytest.mark.parametrize(
    ("text", "problem"),
    [
        ('[[survivor]]\nreason = "Right."', "drive/survivors.toml:2: survivor[0] covers every mutant"),
        (
            '[[survivor]]\nreason = "Right."\noperators = ["port", "larger numbers"]',
            'drive/survivors.toml:3: survivor[0].operators has "larger numbers", expected operators of mutants',
        ),
        ('[[survivor]]\nold = "2"', "drive/survivors.toml:1: reason is missing"),
        ('[[survivor]]\nold = "2"\nreason = ""', "drive/survivors.toml:3: "),
    ],
)
def test_mistakes_in_the_reasons_are_reported_with_their_lines(
    assignment: Path, tmp_path: Path, text: str, problem: str
) -> None:
    folder = tmp_path / "drive"
    shutil.copytree(assignment, folder)
    (folder / "survivors.toml").write_text(text)
    with pytest.raises(AssignmentProblems, match=re.escape(problem)):
        read_survivor_reasons(folder)


@pytest.mark.parametrize("name", [name for name in list_catalogue_ids() if read_survivor_reasons(name)])
def test_each_reason_of_the_catalogue_covers_a_mutant_of_the_reference(name: str) -> None:
    mutants = list(iterate_reference_mutants(read_example(name, REFERENCE), find_assignment(name)))
    for reason in read_survivor_reasons(name):
        assert any(reason.covers(mutant) for mutant in mutants), reason


def test_a_notebook_as_reference_is_reported(assignment: Path, tmp_path: Path, runner: TrialRunner) -> None:
    folder = tmp_path / "drive"
    shutil.copytree(assignment, folder)
    shutil.rmtree(folder / "examples")
    assert "no examples" in check_mutants(str(folder), 5, runner=runner).problem


def test_the_tables_list_the_survivors(check: MutantCheck, capsys: pytest.CaptureFixture[str]) -> None:
    print_renderables(*build_mutant_tables(check))
    assert re.search(r"wrong unit +1 +0 +1 +0 +0\n", capsys.readouterr().out)
    print_renderables(*build_catalogue_mutant_tables([check]))
    assert re.search(r"drive +robot.py +4 +larger number +2 -> 3\n", capsys.readouterr().out)


@pytest.mark.long
def test_the_command_grades_as_many_as_it_may(assignment: Path) -> None:
    ended = robomark("assignments", "check", str(assignment), "--mutants", "3", "--json")
    [checked] = json.loads(ended.stdout)["assignments"]
    assert sum(each["mutants"] for each in checked["mutants"]["operators"]) == 3
    assert {"operators", "survivors", "ungraded", "unexplained_share", "stale_reasons", "problem"} == set(
        checked["mutants"]
    )
