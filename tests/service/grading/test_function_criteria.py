"""Criteria about code: what functions return when they are called inside the sandbox."""

from __future__ import annotations

from typing import Any

import pytest

from judging import criterion
from responders.code import Code
from responders.function_calls import FunctionCall, call_functions
from responders.sandbox.meter import JobMeter
from responders.sandbox.running_child import ChildLimits
from service.grading.grade import Grade
from service.grading.grader import grade
from service.grading.trial_runner import TrialRunner
from sim.recording import Verdict
from submissions.assignment.definition import Assignment, Limits, Parts, WorldSpec
from submissions.criteria import Criterion
from submissions.submission import Submission

LIMITS = ChildLimits(1.0, 256 << 20)


def without_robot(*criteria: Criterion) -> Assignment:
    return Assignment("a", "A", WorldSpec(), Parts("none", "student"), (), criteria)


def graded(text: str, runner: TrialRunner, *criteria: Criterion) -> Grade:
    submission = Submission("ada", responder=Code("responder.py", text))
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
    asked = criterion("functions", function="f", calls=[keys])
    result = grade(
        Submission("ada", responder=Code("responder.py", text)),
        Assignment("a", "A", WorldSpec(), Parts("none", "student"), (), (asked,), limits=Limits(responder_cpu=0.5)),
        runner=runner,
    )
    assert result.marks == marks, result.criteria[0].message
    assert (result.verdict, result.trials) == (Verdict.FINISHED, ())


def test_calls_are_made_one_after_the_other_in_one_process(runner: TrialRunner) -> None:
    text = "count = 0\ndef responder(text, more=0):\n    global count\n    count += 1\n    return count + more\n"
    calls = [{"arguments": [""], "returns": 1}, {"arguments": [""], "named": {"more": 5}, "returns": 7}]
    assert graded(text, runner, criterion("functions", calls=calls)).marks == 4


def test_entries_of_a_list_are_marked_one_by_one(runner: TrialRunner) -> None:
    asked = criterion("functions", function="f", calls=[{"returns": ["a", "b", "c", "d"]}], each=True, at_least=0.75)
    assert graded("def f(): return ['a', 'b', 'c', 'x']", runner, asked).marks == 4
    assert graded("def f(): return ['a', 'b', 'x', 'x']", runner, asked).marks == 2
    assert graded("def f(): return ['a', 'b', 'c', 'd', 'e', 'f', 'g', 'h']", runner, asked).marks == 2


def test_first_wrong_call_is_told(runner: TrialRunner) -> None:
    calls = [{"arguments": [2], "returns": 4}, {"arguments": [3], "returns": 9}]
    result = graded("def f(x): return x + x", runner, criterion("functions", function="f", calls=calls))
    assert result.criteria[0].message == "Expected f(3) to return 9, but it returned 6 (1 of 2 calls right)."
    assert result.sandbox.startswith("Landlock")


def test_same_functions_give_the_same_values(runner: TrialRunner) -> None:
    text = "import random, time\ndef f(): return [random.random(), time.time()]"
    asked = criterion("functions", function="f", calls=[{"returns": 0}])
    assert graded(text, runner, asked).criteria == graded(text, runner, asked).criteria


def test_what_the_module_prints_counts_against_its_output(runner: TrialRunner) -> None:
    text = "def f():\n    for _ in range(100): print('x' * 100)\n    return 1\n"
    called = call_functions(
        Code("responder.py", text), {}, [FunctionCall("f")], LIMITS, 5000, runner._sandboxes, 1, JobMeter()
    )
    fault = called.returned[0].fault
    assert fault is not None
    assert fault.verdict is Verdict.OUTPUT_LIMIT
