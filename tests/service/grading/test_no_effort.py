"""Submissions without effort: what they are, what they earn, and the warnings of ``assignments check``."""

from __future__ import annotations

import json
from dataclasses import replace
from decimal import Decimal
from pathlib import Path

import pytest

from assignment_texts import build_run_text
from command import robomark
from service.grading.answer_guesses import build_reply, collect_guesses
from service.grading.example_check import CheckedAssignment
from service.grading.no_effort import NoEffortResult, build_submissions, grade_without_effort
from service.grading.trial_runner import TrialRunner
from submissions.assignment.reader import find_assignment, read_assignment

_GENEROUS = build_run_text(
    "generous",
    'id = "says"\ntitle = "Says it"\nmarks = 3\ncheck = "reports"\nsource = "speech"\nexpected = [[4], [7], [4]]\n',
    'id = "turns"\ntitle = "Turns round"\nmarks = 1\ncheck = "displacement"\nturn = [170, 190]\n',
    poses="[[200, 800, 0], [200, 500, 0], [200, 300, 0]]",
)
_STRICT = """\
id = "strict"
title = "Answer the question"
[parts]
program = "none"
[[criterion]]
id = "answers"
title = "Answers"
marks = 4
check = "functions"
path = "message.do"
calls = [
    { arguments = ["PY::1"], returns = "left" },
    { arguments = ["PY::2"], returns = "right" },
    { arguments = ["PY::3"], returns = "stop" },
]
[[criterion]]
id = "no-eval"
title = "Does not run what it is sent"
marks = 2
check = "source"
part = "responder"
avoids = ["eval"]
needs = "answers"
"""


def _write_assignment(folder: Path, text: str, **starter: str) -> str:
    (folder / "starter").mkdir(parents=True)
    (folder / "assignment.toml").write_text(text)
    for name, source in starter.items():
        (folder / "starter" / f"{name}.py").write_text(source)
    return str(folder)


def test_marks_without_effort_are_those_of_the_grader(tmp_path: Path, runner: TrialRunner) -> None:
    folder = _write_assignment(tmp_path / "generous", _GENEROUS, robot="say('seven')\n")
    assignment = read_assignment(Path(folder))
    results = grade_without_effort(folder, assignment, runner=runner)
    assert {result.name: str(result.marks) for result in results} == {
        "empty": "2.00",
        "constant": "4.00",
        "all-answers": "2.00",
        "random-driving": "4.00",
        "blind-driving": "4.00",
        "starter": "3.00",
    }
    warnings = CheckedAssignment(assignment, (), (), results).warnings
    assert [warning.partition(";")[0] for warning in warnings if "marks" in warning.partition(";")[0]] == [
        "one constant text gets 4.00 of 6 marks",
        "driving at random gets 4.00 of 6 marks",
        "driving straight on without looking gets 4.00 of 6 marks",
        "the unchanged starter gets 3.00 of 6 marks",
    ]


def test_functions_without_effort_earn_little_if_the_rest_needs_them(tmp_path: Path, runner: TrialRunner) -> None:
    folder = _write_assignment(tmp_path / "strict", _STRICT)
    assignment = read_assignment(Path(folder))
    results = grade_without_effort(folder, assignment, runner=runner)
    assert {result.name: str(result.marks) for result in results} == {
        "empty": "0.00",
        "constant": "1.33",
        "all-answers": "0.00",
        "random-driving": "0.00",
        "blind-driving": "1.33",
    }
    assert CheckedAssignment(assignment, (), (), results).warnings == ()


@pytest.mark.parametrize("name", ["echo-responder", "parser-agent-and-logger", "train-a-recogniser"])
def test_an_assignment_always_has_the_same_submissions_with_all_its_parts(name: str) -> None:
    assignment = find_assignment(name)
    submissions = dict(build_submissions(name, assignment))
    assert {key: each.sha256 for key, each in build_submissions(name, assignment)} == {
        key: each.sha256 for key, each in submissions.items()
    }
    for submission in submissions.values():
        assert (submission.program is not None) == (assignment.parts.program == "student")
        assert submission.responder is not None
        assert submission.files.keys() == {
            f"{agent}.py" for agent, source in assignment.parts.agents.items() if source == "student"
        }
        for source in (submission.program, submission.responder):
            if source is not None and not source.text.startswith("%%"):
                compile(source.text, source.name, "exec")


def test_answers_are_the_most_frequent_first_and_at_their_places() -> None:
    assignment = find_assignment("black-or-grey")
    assert collect_guesses(assignment).constant_text == "grey"
    without_marks = tuple(criterion.model_copy(update={"marks": Decimal(0)}) for criterion in assignment.criteria)
    assert collect_guesses(replace(assignment, criteria=without_marks)).constant_text == "Hello"
    assert build_reply({"message.shape": "square", "message.sure": 1}) == (
        'JSON::{"message": {"shape": "square", "sure": 1}}'
    )
    assert build_reply({"message": "all", "message.shape": "square"}) == 'JSON::{"message": {"shape": "square"}}'
    assert build_reply({"": "square"}) == "square"


def test_the_share_is_notable_from_two_fifths_on() -> None:
    assert NoEffortResult("empty", Decimal("4.00"), Decimal(10)).is_notable
    assert not NoEffortResult("empty", Decimal("3.99"), Decimal(10)).is_notable
    assert not NoEffortResult("empty", None, Decimal(10), "robot.py is missing").is_notable


@pytest.mark.long
def test_the_check_shows_and_exports_what_no_effort_earns(tmp_path: Path) -> None:
    folder = _write_assignment(tmp_path / "generous", _GENEROUS)
    shown = robomark("assignments", "check", folder)
    assert shown.returncode == 0, shown.stderr
    assert "without effort" in shown.stdout
    assert "robomark: generous: one constant text gets 4.00 of 6 marks; give most marks" in shown.stderr
    document = json.loads(robomark("assignments", "check", folder, "--json").stdout)
    (checked,) = document["assignments"]
    assert [(each["name"], float(each["marks"]), each["share"]) for each in checked["no_effort"]][:2] == [
        ("empty", 2.0, 0.3333),
        ("constant", 4.0, 0.6667),
    ]
