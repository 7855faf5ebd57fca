"""Python files beside a submission: imported by each part, reported by name, and checked by the rules about code."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import pytest

from notebook_builder import notebook
from service.grading.grade import Grade
from service.grading.grader import grade
from service.grading.trial_runner import TrialRunner
from service.reports.faults import group_faults
from sim.recording import Fault, Verdict
from submissions.assignment.reader import read_assignment
from submissions.bundle import read_submission
from submissions.source_text import find_modules

TOML = """
id = "talk"
title = "Talk"
given = [{given}]
[parts]
program = "{program}"
responder = "{responder}"
[[scenario]]
id = "one"
poses = [[300, 700, 0]]
seconds = 5
[limits]
program_cpu = 1
[[criterion]]
id = "rules"
title = "Keeps to the rules"
marks = 1
check = "source"
part = "{part}"
avoids = ["eval()"]
uses = ["while"]
"""
DRIVE = "import helper\nimport time\nprint('PY::' + helper.words(3))\ntime.sleep(1)\n"
ANSWER = "import helper\ndef responder(text):\n    return 'heard ' + helper.words(2)\n"
HELPER = "def words(n):\n    while n:\n        return 'hello ' * n\n"


def graded(
    folder: Path,
    runner: TrialRunner,
    files: Mapping[str, str],
    part: str = "program",
    program: str = "student",
    responder: str = "student",
    given: Mapping[str, str] | None = None,
) -> Grade:
    task = folder / "task"
    task.mkdir()
    names = ", ".join(f'"{name}"' for name in given or {} if name not in (program, responder))
    text = TOML.format(given=names, program=program, responder=responder, part=part)
    (task / "assignment.toml").write_text(text)
    for name, source in (given or {}).items():
        (task / name).write_text(source)
    own = folder / "ada"
    own.mkdir()
    for name, source in files.items():
        (own / name).write_text(source)
    assignment = read_assignment(task)
    return grade(read_submission(own, required_parts=assignment.parts), assignment, runner=runner)


def first_fault(result: Grade) -> Fault:
    return result.trials[0].recording.faults[0]


def test_program_and_responder_import_what_lies_beside_them(tmp_path: Path, runner: TrialRunner) -> None:
    files = {"robot.py": DRIVE, "responder.py": ANSWER, "helper.py": "import more\n" + HELPER, "more.py": ""}
    recording = graded(tmp_path, runner, files).trials[0].recording
    assert recording.faults == ()
    assert [message.text for message in recording.messages] == ["PY::hello hello hello ", "heard hello hello "]


@pytest.mark.long
def test_cells_and_their_robot_programs_import_it_too(tmp_path: Path, runner: TrialRunner) -> None:
    cells = ["import helper\n" + ANSWER, "%%sim_magic_preloaded -R -L\n" + DRIVE, "helper.__file__, helper.__name__"]
    own = tmp_path / "own"
    own.mkdir()
    notebook(own / "ada.ipynb", cells)
    (own / "helper.py").write_text(HELPER)
    recording = graded(tmp_path, runner, {each.name: each.read_text() for each in own.iterdir()}).trials[0].recording
    assert recording.faults == ()
    assert [message.text for message in recording.messages] == ["PY::hello hello hello ", "heard hello hello "]
    assert "('helper.py', 'helper')" in recording.responder_output


FAILS = {
    "an error": ("def words(n):\n    return n + ''\n", Verdict.PROGRAM_ERROR, 2),
    "a syntax error": ("def words(n):\n    return n +\n", Verdict.PROGRAM_ERROR, 2),
    "a loop that never waits": (
        "def words(n):\n    from ev3dev2_glue import get_clock\n    while get_clock() < 1:\n        n += 1\n",
        Verdict.CPU_LIMIT,
        3,
    ),
    "a loop that only computes": ("def words(n):\n    while n:\n        n += 1\n", Verdict.CPU_LIMIT, None),
    "what is refused": ("import os\ndef words(n):\n    os.system('ls')\n", Verdict.PROGRAM_ERROR, 3),
}


@pytest.mark.parametrize("how", FAILS)
def test_a_fault_in_such_a_file_has_its_name_and_line(tmp_path: Path, runner: TrialRunner, how: str) -> None:
    helper, verdict, line = FAILS[how]
    result = graded(tmp_path, runner, {"robot.py": DRIVE, "helper.py": helper}, responder="none")
    fault = first_fault(result)
    assert (fault.verdict, fault.file) == (verdict, "helper.py")
    assert line is None or fault.place == f"line {line} of helper.py"
    submission = read_submission(tmp_path / "ada")
    group = group_faults(result, submission)[0]
    assert group.where == f"Robot program, line {fault.line} of helper.py"
    assert [row.text for row in group.excerpt if row.marked] == [helper.split("\n")[(fault.line or 0) - 1]]
    if how == "what is refused":
        assert any(note.startswith("line 3 of helper.py: programs here") for note in result.trials[0].recording.notes)


def test_a_responders_and_a_cells_fault_have_it_too(tmp_path: Path, runner: TrialRunner) -> None:
    files = {"robot.py": "print('PY::0')\n", "responder.py": ANSWER, "helper.py": "def words(n):\n    return n / 0\n"}
    fault = first_fault(graded(tmp_path, runner, files))
    assert (fault.who, fault.place) == ("responder", "line 2 of helper.py")
    cells = [
        "import helper",
        "helper.words(1)",
        "%%sim_magic_preloaded -R\nsay('x')",
        "def responder(text): return text",
    ]
    own = tmp_path / "notebook"
    own.mkdir()
    notebook(own / "ada.ipynb", cells)
    (own / "helper.py").write_text(files["helper.py"])
    assignment = read_assignment(tmp_path / "task")
    notes = grade(read_submission(own, required_parts=assignment.parts), assignment, runner=runner).notes
    assert any(note.startswith("cell 2, line 2 of helper.py: ZeroDivisionError") for note in notes)


@pytest.mark.parametrize("name", ["random", "time", "ev3dev2", "brick_link", "inside", "os"])
def test_no_such_file_stands_in_for_another_module(tmp_path: Path, runner: TrialRunner, name: str) -> None:
    files = {"robot.py": f"import {name}\nprint(hasattr({name}, 'forged'))\n", f"{name}.py": "forged = True\n"}
    recording = graded(tmp_path, runner, files, responder="none").trials[0].recording
    assert [line.text for line in recording.printed] == ["False"]
    expected_note = f"the program: {name}.py is never imported: there is another module of that name, which comes first"
    assert expected_note in recording.notes


def test_what_lies_elsewhere_is_still_not_imported(tmp_path: Path, runner: TrialRunner) -> None:
    (tmp_path / "outside.py").write_text("print('outside')\n")
    program = (
        f"import sys\nsys.path[:0] = ['.', '/tmp', {str(tmp_path)!r}]\n"
        "for name in ('outside', 'responder', 'robot', 'hel' + 'per2', 'helper.more', '.helper'):\n"
        "    try:\n        print('found', __import__(name).__name__)\n"
        "    except ImportError:\n        pass\n"
    )
    files = {"robot.py": program, "responder.py": ANSWER, "helper.py": HELPER, "helper2.py": "", "helper.txt": ""}
    assert graded(tmp_path, runner, files).trials[0].recording.printed == ()


def test_rules_read_what_the_part_can_import_and_name_the_file(tmp_path: Path, runner: TrialRunner) -> None:
    hidden = HELPER + "\ndef never():\n    eval('1')\n"
    result = graded(tmp_path, runner, {"robot.py": DRIVE, "helper.py": hidden}, responder="none").criteria[0]
    assert result.marks == result.max_marks / 2
    assert "helper.py" in result.message
    assert "line 6" in result.message


def test_rules_for_a_program_leave_the_responders_files_alone(tmp_path: Path, runner: TrialRunner) -> None:
    files = {
        "robot.py": "while True:\n    break\n",
        "responder.py": "import parsing\n" + ANSWER,
        "parsing.py": "eval('1')\n",
        "helper.py": HELPER,
    }
    assert graded(tmp_path, runner, files).criteria[0].marks == 1


def test_what_the_assignment_brings_imports_nothing_of_the_students(tmp_path: Path, runner: TrialRunner) -> None:
    given = {"drive.py": DRIVE, "talk.py": ANSWER, "helper.py": HELPER}
    mine = {"responder.py": ANSWER, "helper.py": "def words(n):\n    return 'forged'\n"}
    messages = graded(tmp_path, runner, mine, "responder", program="drive.py", given=given).trials[0].recording.messages
    assert [message.text for message in messages] == ["PY::hello hello hello ", "heard forged"]
    (tmp_path / "second").mkdir()
    mine = {"robot.py": DRIVE, "helper.py": mine["helper.py"]}
    messages = graded(tmp_path / "second", runner, mine, responder="talk.py", given=given).trials[0].recording.messages
    assert [message.text for message in messages] == ["PY::forged", "heard hello hello "]


def test_another_helper_is_another_submission_with_other_chance(tmp_path: Path, runner: TrialRunner) -> None:
    program = "import random, helper\nprint(random.random())\n"
    drawn = set()
    for number in range(2):
        folder = tmp_path / str(number)
        folder.mkdir()
        result = graded(folder, runner, {"robot.py": program, "helper.py": f"# {number}\n"}, responder="none")
        drawn.add(result.trials[0].recording.printed[0].text)
    assert len(drawn) == 2


IMPORTS = {
    "import helper": {"helper"},
    "from helper import words as w": {"helper"},
    "import os, \\\n  helper": {"helper"},
    "import importlib; importlib.import_module('helper')": {"helper"},
    "__import__('helper')": {"helper"},
    "import chain": {"chain", "helper"},
    "import circle": {"circle"},
    "helper = 1": set(),
    "import elsewhere, nul, latin": {"latin"},
}


@pytest.mark.parametrize("text", IMPORTS)
def test_a_text_can_import_what_it_names_on_a_line_with_an_import(text: str) -> None:
    files = {
        "helper.py": b"",
        "chain.py": b"from helper import *",
        "circle.py": b"import circle",
        "nul.py": b"\0",
        "latin.py": b"caf\xe9 = 1",
        "other.py": b"",
    }
    assert find_modules(text, files.get).keys() == IMPORTS[text]
