"""Criteria about code: an instructor's checks in Python, and criteria that do not fit their target."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path

import pytest

from responders.source_file import SourceFile
from service.grading.grade import Grade
from service.grading.grader import grade
from service.grading.trial_runner import TrialRunner
from service.reports.formats.text import render_plain_text
from service.reports.view import build_staff_view, build_student_view
from submissions.assignment.definition import Assignment
from submissions.assignment.problems import AssignmentProblems
from submissions.assignment.reader import read_assignment
from submissions.submission import Submission

HEAD = """
id = "a"
title = "A"
[parts]
responder = "none"
[[scenario]]
id = "s"
poses = [[100, 800, 0], [100, 400, 0]]
seconds = 5
[[criterion]]
id = "checked"
title = "C"
marks = 4
check = "python"
file = "check.py"
over = "mean"
"""


def checked(folder: Path, check: str, runner: TrialRunner) -> Grade:
    folder.mkdir(exist_ok=True)
    (folder / "assignment.toml").write_text(HEAD)
    (folder / "check.py").write_text(check)
    program = SourceFile("robot.py", "print('Light_left: 3 1')\ntank_drive.on_for_seconds(50, 50, 1)\nsay('x')")
    return grade(Submission("ada", program), read_assignment(folder), runner=runner)


def test_a_check_in_python_sees_the_recording_and_says_what_it_found(tmp_path: Path, runner: TrialRunner) -> None:
    text = """
def check(trial):
    way = trial["end"]["x"] - trial["start"]["x"]
    same = way == trial["ticks"]["x"][-1] - 100 and len(trial["ticks"]["left_rgb"][0]) == 3
    assert same and trial["spoken"][0][1] == "x" and trial["datalog"][0][1:] == ["Light_left", 3.0, 1.0]
    high = trial["start"]["y"] > 500
    return {"passed": high, "score": 0.5, "message": f"went {way:.1f} mm", "measures": {"way": way}}
"""
    result = checked(tmp_path / "a", text, runner).criteria[0]
    assert result.marks == 3
    assert "went 172.1 mm" in result.message
    assert [(each.passed, each.measures[0].name) for each in result.evidence] == [(True, "way"), (False, "way")]
    assert result.evidence[0].measures[0].value == pytest.approx(172.0685, abs=0.01)


@pytest.mark.parametrize("value", ["1 nan", "nan 1", "inf 1", "1e308 1", "1 -1e308", "1e999 2"])
def test_no_number_that_a_student_prints_breaks_a_check(value: str, tmp_path: Path, runner: TrialRunner) -> None:
    (tmp_path / "assignment.toml").write_text(HEAD)
    (tmp_path / "check.py").write_text(
        "def check(trial):\n"
        "    numbers = [number for _, _, *both in trial['datalog'] for number in both if number is not None]\n"
        "    return {'passed': not numbers, 'score': sum(numbers) - sum(numbers), 'measures': {'sum': sum(numbers)}}\n"
    )
    program = SourceFile("robot.py", f"print('Light_left: {value}')\n" * 3)
    assert grade(Submission("ada", program), read_assignment(tmp_path), runner=runner).marks == 4


@pytest.mark.parametrize(
    ("check", "words"),
    [
        ("def check(trial): return 1 / 0", r"check\.py: ZeroDivisionError: division by zero \(line 1\)"),
        ("def other(trial): return True", "there is no function called check"),
        ("def check(trial): return 'yes'", "expected True, False or a dict"),
        ("def check(trial): return {'passed': True, 'score': 'all'}", "score a number"),
        ("def check(trial): return {'passed': 1}", "expected True, False or a dict"),
        ("import os\ndef check(trial): return os.listdir('/') == []", "PermissionError"),
        ("def check(", "SyntaxError"),
    ],
)
def test_a_check_that_fails_leaves_its_line_unjudged(
    check: str, words: str, tmp_path: Path, runner: TrialRunner
) -> None:
    (result,) = checked(tmp_path / "a", check, runner).criteria
    assert result.marks == 0
    assert result.message == "This criterion could not be judged. Staff will review it."
    assert re.search(words, result.unjudged)
    assert result.unjudged in result.for_staff


#: A check that trusts its input, and a line that every program earns by reaching its end.
TRUSTING = """
import json, re
def check(trial):
    kind, _, text = trial["printed"][0][1].partition(" ")
    if kind == "number": return {"passed": int(text) > 0}
    if kind == "score": return {"passed": False, "score": 10 ** int(text)}
    if kind == "measure": return {"passed": True, "measures": {"it": 10 ** int(text)}}
    if kind == "ratio": return {"passed": 1 / float(text) > 2}
    if kind == "pattern": return bool(re.fullmatch(r"(\\w+\\s?)+\\$", text))
    if kind == "json": return {"passed": bool(json.loads(text))}
    if kind == "echo": return {"passed": False, "message": text * 100_000}
    if kind == "room": return len([0] * 10 ** int(text)) > 0
    if kind == "words": return {"passed": text.split()[3] == "x"}
    if kind == "print":
        for _ in range(10 ** int(text)): print("x" * 1000)
    return True
"""
MISLEADING = (
    "number x",
    "number " + "9" * 5000,
    "score 400",
    "score 5000",
    "measure 5000",
    "ratio 0",
    "ratio nan nan",
    "pattern " + "a" * 60 + "!",
    "json " + "[" * 5000,
    "echo " + "y" * 100,
    "room 12",
    "words few",
    "print 9",
)


@pytest.fixture(scope="module")
def trusting(tmp_path_factory: pytest.TempPathFactory) -> Assignment:
    folder = tmp_path_factory.mktemp("trusting")
    ended = '[[criterion]]\nid = "ended"\ntitle = "E"\nmarks = 2\ncheck = "finishes"\n'
    limits = "[limits]\nresponder_cpu = 1\nresponder_memory_mb = 128\noutput_bytes = 50000\n"
    (folder / "assignment.toml").write_text(HEAD.replace("[parts]", f"{limits}[parts]") + ended)
    (folder / "check.py").write_text(TRUSTING)
    return read_assignment(folder)


@pytest.mark.long
@pytest.mark.parametrize("text", MISLEADING, ids=lambda text: text[:12])
def test_no_text_of_a_students_ends_the_job_by_way_of_a_check(
    text: str, trusting: Assignment, runner: TrialRunner
) -> None:
    result = grade(Submission("ada", SourceFile("robot.py", f"print({text!r})")), trusting, runner=runner)
    checked_result, ended = result.criteria
    assert checked_result.marks == 0
    assert checked_result.unjudged
    assert ended.marks == 2
    assert not ended.unjudged
    plain_text = render_plain_text(build_staff_view(result))
    assert "For staff: Could not be judged: " in plain_text
    output = render_plain_text(build_student_view(result))
    assert "This criterion could not be judged. Staff will review it." in output
    assert checked_result.unjudged[:30] not in output


def test_a_check_has_what_it_needs_when_the_submission_has_used_up_its_own(
    trusting: Assignment, runner: TrialRunner
) -> None:
    few = replace(trusting, limits=replace(trusting.limits, all_cpu=2.5))
    program = SourceFile("robot.py", "print('json [1]')\nwhile True: pass")
    checked_result, ended = grade(Submission("ada", program), few, runner=runner).criteria
    assert ended.marks == 0
    assert not checked_result.unjudged
    assert checked_result.evidence[0].passed


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (
            ('check = "python"\nfile = "check.py"', 'check = "functions"\ncalls = [{ arguments = [3] }]'),
            "without returns or one_of",
        ),
        (('title = "A"', 'title = "A"\ngiven = ["check.py"]'), r'given names "check\.py", which contains answers'),
        (("check.py", "other.py"), r'file is "other\.py", expected a \.py file beside this file'),
        (
            ('check = "python"\nfile = "check.py"', 'check = "ranking"\nof = "x"\nmeasure = "time"\nsteps = [[1, 1]]'),
            'of is "x"',
        ),
        (
            ('check = "python"\nfile = "check.py"', 'check = "functions"\ncalls = [{ returns = 1 }]'),
            "looks at the responder",
        ),
        (('responder = "none"', 'program = "none"'), "a trial runs a program"),
    ],
)
def test_what_does_not_fit_together_is_named(change: tuple[str, str], words: str, tmp_path: Path) -> None:
    (tmp_path / "assignment.toml").write_text(HEAD.replace(*change))
    (tmp_path / "check.py").write_text("def check(trial): return True")
    with pytest.raises(AssignmentProblems, match=words):
        read_assignment(tmp_path)


def test_a_run_cannot_be_judged_where_no_robot_runs(tmp_path: Path) -> None:
    text = (
        'id = "a"\ntitle = "A"\n[parts]\nprogram = "none"\n[[criterion]]\ntitle = "F"\nmarks = 1\ncheck = "finishes"\n'
    )
    (tmp_path / "assignment.toml").write_text(text)
    with pytest.raises(AssignmentProblems, match="check judges a run of the robot"):
        read_assignment(tmp_path)
