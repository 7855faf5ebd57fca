"""Criteria about code: return values of functions that are called inside the sandbox."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import pytest
from pydantic import ValidationError

from judging import criterion
from responders.function_calls import FunctionCall, call_functions
from responders.sandbox.meter import JobMeter
from responders.sandbox.running_child import ChildLimits
from responders.source_file import SourceFile
from service.grading.grade import Grade
from service.grading.grader import grade
from service.grading.trial_runner import TrialRunner
from service.reports.formats.json_output import render_json
from service.reports.html import render_report_page
from service.reports.view import build_student_view
from sim.recording import Verdict
from submissions.assignment.definition import Assignment, Parts, WorldSpec
from submissions.assignment.limits import Limits
from submissions.assignment.problems import AssignmentProblems
from submissions.assignment.reader import read_assignment
from submissions.criteria import Criterion
from submissions.submission import Submission

LIMITS = ChildLimits(1.0, 256 << 20)


def without_robot(*criteria: Criterion) -> Assignment:
    return Assignment("a", "A", WorldSpec(), Parts("none", "student"), (), criteria)


def graded(text: str, runner: TrialRunner, *criteria: Criterion) -> Grade:
    submission = Submission("ada", responder=SourceFile("responder.py", text))
    return grade(submission, without_robot(*criteria), runner=runner)


@pytest.mark.parametrize(
    ("keys", "text", "marks"),
    [
        ({"returns": 3}, "def f(): return 3", 4),
        ({"returns": 3}, "def f(): return 3.0", 4),
        ({"returns": 3}, "def f(): return True", 0),
        ({"returns": 1}, "def f(): return True", 0),
        ({"returns": None}, "def f(): pass", 4),
        ({"returns": [1, {"a": [2]}]}, "def f(): return (1, {'a': [2.0]})", 4),
        ({"returns": [0, 1]}, "import numpy as np\ndef f(): return np.arange(2)", 4),
        ({"returns": [1, 2]}, "def f(): return {2, 1}", 4),
        ({"returns": "a b"}, "def f(): return ' a   b '", 4),
        ({"returns": "A"}, "def f(): return 'a'", 0),
        ({"one_of": ["heads", "tails"]}, "import random\ndef f(): return random.choice(['heads', 'tails'])", 4),
        ({"returns": 1}, "def f(): raise KeyError('x')", 0),
        ({"returns": 1}, "def g(): return 1", 0),
        ({"returns": 1}, "f = 1", 0),
        ({"returns": 1}, "def f(", 0),
        ({"returns": 1}, "def f(): return object()", 0),
        ({"returns": 1}, "def f(): return float('nan')", 0),
        ({"returns": "x"}, "def f(): return 'x' * 100_000", 0),
        ({"returns": 1}, "import os\ndef f(): os._exit(0)", 0),
        ({"returns": 1}, "def f():\n    while True: pass", 0),
        ({"returns": 1}, "def f(): return 10 ** 400", 0),
        ({"returns": 1}, "def f():\n    x = []\n    x.append(x)\n    return x", 0),
    ],
)
def test_what_a_function_returns(keys: dict[str, Any], text: str, marks: int, runner: TrialRunner) -> None:
    rule = criterion("functions", function="f", calls=[keys])
    result = grade(
        Submission("ada", responder=SourceFile("responder.py", text)),
        Assignment("a", "A", WorldSpec(), Parts("none", "student"), (), (rule,), limits=Limits(responder_cpu=0.5)),
        runner=runner,
    )
    assert result.marks == marks, result.criteria[0].message
    assert (result.verdict, result.trials) == (Verdict.FINISHED, ())


def test_calls_are_made_one_after_the_other_in_one_process(runner: TrialRunner) -> None:
    text = "count = 0\ndef responder(text, more=0):\n    global count\n    count += 1\n    return count + more\n"
    calls = [{"arguments": [""], "returns": 1}, {"arguments": [""], "named": {"more": 5}, "returns": 7}]
    assert graded(text, runner, criterion("functions", calls=calls)).marks == 4


def test_entries_of_a_list_are_marked_one_by_one(runner: TrialRunner) -> None:
    rule = criterion("functions", function="f", calls=[{"returns": ["a", "b", "c", "d"]}], each=True, at_least=0.75)
    assert graded("def f(): return ['a', 'b', 'c', 'x']", runner, rule).marks == 4
    assert graded("def f(): return ['a', 'b', 'x', 'x']", runner, rule).marks == 2
    assert graded("def f(): return ['a', 'b', 'c', 'd', 'e', 'f', 'g', 'h']", runner, rule).marks == 2


def test_first_wrong_call_is_told(runner: TrialRunner) -> None:
    calls = [{"arguments": [2], "returns": 4}, {"arguments": [3], "returns": 9}]
    result = graded("def f(x): return x + x", runner, criterion("functions", function="f", calls=calls))
    assert result.criteria[0].message == "Expected f(3) to return 9, but it returned 6 (1 of 2 calls correct)."
    assert result.sandbox.startswith("Landlock")


def test_same_functions_give_the_same_values(runner: TrialRunner) -> None:
    text = "import random, time\ndef f(): return [random.random(), time.time()]"
    rule = criterion("functions", function="f", calls=[{"returns": 0}])
    assert graded(text, runner, rule).criteria == graded(text, runner, rule).criteria


def test_what_the_module_prints_counts_against_its_output(runner: TrialRunner) -> None:
    text = "def f():\n    for _ in range(100): print('x' * 100)\n    return 1\n"
    called = call_functions(
        SourceFile("responder.py", text), {}, [FunctionCall("f")], LIMITS, 5000, runner._sandboxes, 1, JobMeter()
    )
    fault = called.returned[0].fault
    assert fault is not None
    assert fault.verdict is Verdict.OUTPUT_LIMIT


SQUARES = [
    {"arguments": [2], "returns": 4},
    {"arguments": [3], "returns": 9, "hidden": True},
    {"arguments": [-5], "returns": 25, "hidden": True},
]


@pytest.mark.parametrize(
    ("text", "marks", "words"),
    [
        ("def f(x): return x * x", "4.00", "3 of 3 calls correct"),
        (
            "def f(x): return 4",
            "1.33",
            "Expected the right values in all 2 hidden calls as well, but 0 of them were right (1 of 3 calls correct).",
        ),
        ("def f(x): return 2 * x", "1.33", "Expected the right values in all 2 hidden calls"),
        (
            "def f(x): return abs(x) ** 3",
            "0.00",
            "Expected f(2) to return 4, but it returned 8 (0 of 3 calls correct).",
        ),
        ("def g(x): return 0", "0.00", "there is no function called f"),
    ],
)
def test_of_hidden_calls_the_count_is_told(text: str, marks: str, words: str, runner: TrialRunner) -> None:
    result = graded(text, runner, criterion("functions", function="f", calls=SQUARES)).criteria[0]
    assert str(result.marks) == marks
    assert words in result.message


#: Ways in which a function handles an unseen argument, with correct answers to the visible ones.
_LEAKS = {
    "returns it": "return 4 if x == 2 else [x, 'look']",
    "raises it": "if x != 2: raise ValueError(x)\n    return 4",
    "raises on a line of its own": "if x == 2: return 4\n    if x == 3: raise ValueError\n    return 1 / 0",
    "prints it": "print(x)\n    return 4 if x == 2 else 0",
    "ends the process": "import os\n    if x == 3: os._exit(0)\n    return 4",
    "names the lack of a function": "if x == 3: raise ValueError('there is no function called f')\n    return 4",
    "is refused something": "if x == 3:\n        try: open('/etc/passwd')\n        except OSError: pass\n    return 4",
}


@pytest.mark.parametrize("leak", _LEAKS)
def test_what_is_done_with_a_hidden_argument_is_not_told(leak: str, runner: TrialRunner) -> None:
    text = f"def f(x):\n    {_LEAKS[leak]}\n"

    def read(hidden: int) -> str:
        calls = [SQUARES[0], {"arguments": [hidden], "returns": "never", "hidden": True}]
        rule = build_student_view(graded(text, runner, criterion("functions", function="f", calls=calls)))
        return render_json(rule) + render_report_page(
            rule, {}, Submission("ada", responder=SourceFile("responder.py", text))
        )

    assert read(3) == read(7)


def test_staff_read_which_hidden_call_went_wrong(runner: TrialRunner) -> None:
    rule = criterion("functions", function="f", calls=SQUARES)
    result = graded("def f(x): return x + x", runner, rule).criteria[0]
    assert (
        result.for_staff == "The first hidden call with a wrong result: Expected f(3) to return 9, but it returned 6."
    )


def test_a_hidden_call_cannot_be_told_by_a_later_one() -> None:
    with pytest.raises(ValidationError, match="expected the hidden ones last"):
        criterion("functions", calls=SQUARES[::-1])


_TABLE = """
id = "a"
title = "A"
[parts]
program = "none"
[[criterion]]
title = "Names the letters"
marks = 4
check = "functions"
function = "kind"
table = "letters.csv"
at_least = 0.9
"""
_LETTERS = "kind,letter\n" + "".join(
    f"{'vowel' if letter in 'aeiou' else 'other'},{letter}\n" for letter in "abcdefghijklmnopqrst"
)


@pytest.mark.parametrize(
    ("text", "marks", "words"),
    [
        ("def kind(x): return 'vowel' if x in 'aeiou' else 'other'", "4.00", "at least 90% of 20 calls correct"),
        ("def kind(x): return 'vowel' if x in 'aei' else 'other'", "4.00", "at least 90% of 20 calls correct"),
        (
            "def kind(x): return 'other'",
            "3.20",
            "Expected kind to be correct in 90% of 20 calls, but it was correct in about 80%.",
        ),
        ("def kind(x): return 1.0", "0.00", "but it was correct in about 0%"),
        ("def accuracy(): return 1.0", "0.00", "there is no function called kind"),
    ],
)
def test_accuracy_is_measured_on_what_we_pass(
    text: str, marks: str, words: str, runner: TrialRunner, tmp_path: Path
) -> None:
    (tmp_path / "assignment.toml").write_text(_TABLE)
    (tmp_path / "letters.csv").write_text(_LETTERS)
    assignment = read_assignment(tmp_path)
    result = grade(Submission("ada", responder=SourceFile("responder.py", text)), assignment, runner=runner).criteria[0]
    assert str(result.marks) == marks
    assert words in result.message


@pytest.mark.parametrize(
    ("rows", "words"),
    [
        (None, 'table is "letters.csv", expected a CSV file'),
        ("kind,letter\n", "has 0 rows"),
        ("kind,letter\nvowel,a\nother\n", "letters.csv:3 has 1 cells, expected 2"),
        ("kind,letter\n" + "vowel,a\n" * 1001, "has 1001 rows"),
    ],
)
def test_a_table_that_cannot_be_used_is_refused(rows: str | None, words: str, tmp_path: Path) -> None:
    (tmp_path / "assignment.toml").write_text(_TABLE)
    if rows is not None:
        (tmp_path / "letters.csv").write_text(rows)
    with pytest.raises(AssignmentProblems, match=re.escape(words)):
        read_assignment(tmp_path)
