"""Criteria about code: required and forbidden elements of a text, read inside the sandbox."""

from __future__ import annotations

from typing import Any

import pytest

from judging import criterion
from responders.sandbox.meter import JobMeter
from responders.source_file import SourceFile
from service.grading.grade import CriterionResult
from service.grading.grader import grade
from service.grading.judging.code import judge_source
from service.grading.judging.outcome import Outcome
from service.grading.judging.source_answers import SourceAnswers
from service.grading.run_plan import plan_run
from service.grading.static_analysis import analyse
from service.grading.trial_runner import TrialRunner
from sim.recording import Pose
from submissions.assignment.definition import Assignment, Parts, Scenario, WorldSpec
from submissions.criteria import Criterion
from submissions.magics import split_program
from submissions.notebook_python import extract_python
from submissions.submission import Cell, Notebook, Submission


def without_robot(*criteria: Criterion) -> Assignment:
    return Assignment("a", "A", WorldSpec(), Parts("none", "student"), (), criteria)


def answers(text: str, runner: TrialRunner, **rules: Any) -> SourceAnswers:
    assignment = Assignment("a", "A", WorldSpec(), Parts("student", "none"), (), (criterion("source", **rules),))
    plan = plan_run(Submission("ada", program=SourceFile("robot.py", text)), assignment)
    return analyse(plan, (), runner, JobMeter()).answers["c"]


def judged(text: str, runner: TrialRunner, **rules: Any) -> Outcome:
    flags, program = split_program(text)
    return judge_source(criterion("source", **rules), answers(program, runner, **rules), flags)  # type: ignore[arg-type]


PROGRAM = """%%sim_magic_preloaded -b Loop -pR
import time
from ev3dev2.sound import Sound as Voice
def square(side):
    global count
    for _ in range(4):
        tank_drive.on_for_rotations(SpeedPercent(40), SpeedPercent(40), side)
        if colorLeft.rgb[0] > 3: break
    else:
        say("done")
while True:
    square(2)
    names = [name for name in "abc"]
"""


@pytest.mark.parametrize(
    ("rules", "holds"),
    [
        ({"uses": ["for", "while", "if", "else", "break", "def", "global", "comprehension"]}, True),
        ({"uses": ["try"]}, False),
        ({"uses": ["say()", "range()", "tank_drive.on_for_rotations()", "on_for_rotations()"]}, True),
        ({"uses": ["on()"]}, False),
        ({"uses": ["on_for_*()"]}, True),
        ({"avoids": ["on_for_*()"]}, False),
        ({"avoids": ["on_for_seconds()", "import random", "colorRight"]}, True),
        ({"uses": ["import time", "import ev3dev2", "import ev3dev2.sound"]}, True),
        ({"uses": ["import ev3"]}, False),
        ({"uses": ["colorLeft", "colorLeft.rgb", "rgb"]}, True),
        ({"uses": ["color"]}, False),
        ({"in_loop": ["square()", "on_for_rotations()"], "defines": ["square"]}, True),
        ({"in_loop": ["square()"]}, False),
        ({"in_loop": ["Sound()"]}, False),
        ({"defines": ["square"]}, True),
        ({"defines": ["triangle"]}, False),
        ({"flags": ["-b Loop", "-p", "-R"]}, True),
        ({"flags": ["-b Square"]}, False),
        ({"flags": ["--autorun"]}, True),
    ],
)
def test_rules_on_the_text(rules: dict[str, Any], holds: bool, runner: TrialRunner) -> None:
    outcome = judged(PROGRAM, runner, **rules)
    assert outcome.passed is holds, outcome.message


def test_rule_that_is_broken_is_told_with_its_line(runner: TrialRunner) -> None:
    outcome = judged(PROGRAM, runner, avoids=["while", "say()"], uses=["for"])
    assert outcome.message == (
        "Expected your program not to use a while loop, but line 11 uses it. "
        "Expected your program not to use say(), but line 10 uses it."
    )
    assert outcome.score == pytest.approx(1 / 3)


@pytest.mark.parametrize(
    ("text", "error"),
    [
        ("x = (", "'(' was never closed (line 1)"),
        ("print 'x'", "Missing parentheses"),
        ("(" * 50_000, "too many nested parentheses"),
        ("-" * 200_000 + "1", "nested too deeply"),
        ("x" + ".y" * 100_000, "nested too deeply"),
        ("x = " + "+".join("1" * 100_000), "nested too deeply"),
        ("if x:\n" + "".join(" " * (depth + 1) + "if x:\n" for depth in range(98)) + " " * 100 + "pass\n", ""),
        ("\n".join(f"name_{i}.part_{i}({i})" for i in range(4_000)), ""),
        ("for i in x:\n" + "".join(f"    {chr(0x4E00 + i) * 40}.f()\n" for i in range(900)), ""),
        ("x = 1\n" * 60_000, "more than 300000 characters"),
        ("'" + "\\N{DIGIT ONE}" * 1000 + "'", ""),
        ("x = '\ud800'", "characters"),
    ],
)
def test_hostile_texts_are_read_or_refused_inside_the_sandbox(text: str, error: str, runner: TrialRunner) -> None:
    outcomes = answers(text, runner, avoids=["say()", "import time"], uses=["for"])
    assert error in outcomes.error
    assert bool(outcomes.error) is bool(error)


def test_what_is_avoided_cannot_be_hidden_behind_many_names(runner: TrialRunner) -> None:
    many = "\n".join(f"name_{i}({i})" for i in range(9_000))
    assert judged(many, runner, avoids=["eval()"]).passed
    assert "line 9001 uses it" in judged(f"{many}\neval('1')", runner, avoids=["eval()"]).message


LONG = "robot_" * 12


@pytest.mark.parametrize(
    ("rule", "text", "line"),
    [
        ("say()", "from ev3dev2_glue import say as speak\nspeak('x')", 1),
        ("say()", "x = 1\nspeak = say\nspeak('x')", 2),
        ("say()", "list(map(say, 'abc'))", 1),
        ("say()", "@say\ndef f(): pass", 1),
        ("say()", "say.__call__('x')", 1),
        ("say()", "globals()['say']('x')", 1),
        ("say()", "getattr(ev3dev2_glue, 'say')('x')", 1),
        ("on_for_*()", f"{LONG} = tank_drive\n{LONG}.on_for_seconds(1, 2, 3)", 2),
        ("on_for_*()", "go = tank_drive.on_for_seconds\ngo(1, 2, 3)", 1),
        ("eval", "x = 1\ny = __builtins__.eval('1')", 2),
        ("import sklearn", "import importlib\nimportlib.import_module('sklearn.svm')", 2),
        ("import sklearn", "__import__('sklearn')", 1),
        ("import sklearn", "import sys\nsys.modules['sklearn.svm'].SVC()", 2),
        ("try", "try:\n    f()\nexcept* OSError:\n    pass", 1),
        ("sum()", "sum = 0\nfor i in x:\n    sum += i\nprint(sum)", None),
        ("say()", "print('say')\nstay = lambda say: say + 1", None),
        ("on_for_*()", "tank_drive.on(3, 3)", None),
    ],
)
def test_another_name_does_not_hide_what_is_avoided(
    rule: str, text: str, line: int | None, runner: TrialRunner
) -> None:
    outcome = judged(text, runner, avoids=[rule])
    assert outcome.passed is (line is None), outcome.message
    assert line is None or f"line {line} uses it" in outcome.message


def test_what_a_text_cannot_show_is_told_to_staff(runner: TrialRunner) -> None:
    outcome = judged("x = 1\nexec(''.join(['s', 'ay(1)']))", runner, avoids=["say()"])
    assert outcome.passed
    assert outcome.message == "The code of your program is as expected."
    assert outcome.for_staff == "The code may do more than it shows: line 2 has exec."


@pytest.mark.parametrize(
    "text",
    [
        "import cProfile\ncProfile.run('tank_' + 'drive.on_' + 'for_degrees(1, 1, 9)')",
        "import timeit\ntimeit.Timer('tank_drive.on_' + go).timeit(1)",
        "import string\nstring.Formatter().get_field('0.on_' + go, [tank_drive], {})",
        "import logging.config\nlogging.config.BaseConfigurator({}).resolve('ev3dev2_glue.' + go)",
        "import xmlrpc.server\nxmlrpc.server.resolve_dotted_attribute(tank_drive, 'on_' + go)",
        # Other modules, and other ways to import the same ones.
        *(
            f"import {name}\n{name}.run(go)"
            for name in ("profile", "bdb", "pdb", "trace", "doctest", "sched", "turtle")
        ),
        *(
            f"import {name}"
            for name in ("unittest.mock", "multiprocessing", "threading", "asyncio", "types", "os", "sys")
        ),
        "from string import Formatter as F\nF().get_field(go, [tank_drive], {})",
        "from string import *\nFormatter().vformat(go, [tank_drive], {})",
        "from sys import _getframe as frame\nframe()",
        "import collections\ncollections._sys.modules[go]",
        "from random import _os\n_os.sys",
        "import enum\nenum.bltns.eval(go)",
        "import statistics as s\ns.sys.modules[go]",
        "import typing\ntyping.get_type_hints(go)",
        "from functools import singledispatch as on_type\non_type(go)",
        "import pandas as pd\npd.eval(go)",
        "import pandas as pd\npd.DataFrame({}).query(go)",
        "from numpy.testing import measure\nmeasure(go)",
        "import numpy as np\nnp.testing.measure(go)",
        "import numpy.f2py",
        "import no_such_module",
    ],
)
def test_what_runs_or_looks_up_a_text_is_doubtful(text: str, runner: TrialRunner) -> None:
    outcome = judged(text, runner, avoids=["on_for_*()"])
    assert outcome.passed
    assert "The code may do more than it shows: line " in outcome.for_staff


@pytest.mark.parametrize(
    "text",
    [
        *(f"import {name}" for name in ("math", "time", "json", "random", "statistics", "re", "datetime", "csv")),
        "from collections import Counter, deque\nfrom dataclasses import dataclass\nfrom enum import Enum",
        "import collections.abc, itertools, functools, string\nstring.digits, functools.partial(print)",
        "import datetime\ndatetime.datetime.now().time()",
        "from ev3dev2.motor import MoveTank\nfrom ev3dev2_glue import say\nsay('x')",
        "import numpy as np\nimport pandas as pd\nnp.random.rand(3), np.trace(x), pd.read_csv('a')",
        "from sklearn.neural_network import MLPClassifier\nfrom nn_tools.sensor_data import x",
        "from matplotlib import pyplot as plt\nplt.plot([1])",
    ],
)
def test_harmless_modules_are_no_doubt(text: str, runner: TrialRunner) -> None:
    assert judged(text, runner, avoids=["on_for_*()"]).for_staff == ""


@pytest.mark.long
@pytest.mark.parametrize(
    ("helper", "words"),
    [
        ("import math\nfrom sklearn import svm", "line 2 of helper.py uses it"),
        ("x = 1\n" * 60_000, "helper.py cannot be read: it has more than 300000 characters"),
        ("print 'this was never Python 3'", ""),
        ("import math", ""),
    ],
)
def test_files_beside_the_responder_are_read_too(helper: str, words: str, runner: TrialRunner) -> None:
    rules = criterion("source", part="responder", avoids=["import sklearn"])
    submission = Submission(
        "ada",
        responder=SourceFile("responder.py", "import helper\ndef responder(text): return text"),
        files={"helper.py": helper.encode(), "notes.txt": b"import sklearn"},
    )
    result = grade(submission, without_robot(rules), runner=runner).criteria[0]
    assert result.marks == (0 if words else 4), result.message
    assert words in result.message


SOUND: dict[str, Any] = {
    "unread": None,
    "uses": [["", 3]],
    "avoids": [],
    "in_loop": [],
    "defines": [],
    "shown": [None, None],
    "doubts": [],
}


@pytest.mark.parametrize(
    "answer",
    [
        *(None, 3, [], {}, {"unread": None}),
        *(SOUND | {"uses": uses} for uses in ([], [None, None], [3], [["x"]], [["x", "y"]], None)),
        *(SOUND | {"doubts": doubts} for doubts in ([1], [["", "x", ""]], None)),
        *(SOUND | {"unread": unread} for unread in (["x"], ["", "", "x"], 3)),
    ],
)
def test_nonsense_from_the_reader_is_no_answer(answer: Any) -> None:
    rules = criterion("source", uses=["for"])
    assert SourceAnswers.read(SOUND, rules).uses  # type: ignore[arg-type]
    assert SourceAnswers.read(answer, rules).error == "it cannot be read"  # type: ignore[arg-type]


def test_text_of_a_notebook_is_its_plain_cells() -> None:
    cells = (
        "%%sim_magic_preloaded\nsay('x')",
        "import re\n%matplotlib inline",
        "if re:\n    !ls\n",
        "%%writefile a\nx",
        "%%capture out\nimport math\n%time import json",
    )
    notebook = Notebook("a.ipynb", tuple(Cell(number, text) for number, text in enumerate(cells, 1)))
    text = extract_python(notebook)
    compile(text, "a", "exec")
    assert "say" not in text
    assert "import re" in text
    assert "import math\nimport json" in text


DRIVES = "import time\ntank_drive.on_for_seconds(20, 20, 0.1)\n"


def driven_by(text: str, runner: TrialRunner, *, visibility: str = "visible", **rules: Any) -> CriterionResult:
    scenario = Scenario("s", (Pose(200, 600, 0),), seconds=5, visibility=visibility)  # type: ignore[arg-type]
    rule = criterion("source", **rules)
    drives = Assignment("a", "A", WorldSpec(), Parts("student", "none"), (scenario,), (rule,))
    program = SourceFile("robot.py", f"%%sim_magic_preloaded\n{text}")
    files = {"helper.py": b"def twice(go):\n    for _ in range(2):\n        go()\n"}
    return grade(Submission("ada", program=program, files=files), drives, runner=runner).criteria[0]


@pytest.mark.long
@pytest.mark.parametrize(
    ("text", "rules", "holds"),
    [
        ("while time.time() < 0: say('x')", {"uses": ["while"]}, False),
        ("while time.time() < 0:\n    say('x')", {"in_loop": ["say()"]}, False),
        ("while time.time() > 0: say('x'); break", {"uses": ["while"], "in_loop": ["say()"]}, True),
        ("for x in list(): say('x')", {"uses": ["for"]}, False),
        ("for x in list('ab'): say(x)", {"uses": ["for"], "in_loop": ["say()"]}, True),
        ("for x in list(): pass\nfor x in 'ab': say(x)", {"uses": ["for"]}, True),
        ("say('x')\nwhile time.time() < 0: say('y')", {"in_loop": ["say()"]}, False),
        ("def f(): say('x')\nf()\nwhile time.time() < 0: f()", {"in_loop": ["say()"]}, False),
        ("def f(): say('x')\nfor _ in 'ab': f()", {"in_loop": ["say()"]}, True),
        ("if time.time() < 0: pass\nelse: pass", {"uses": ["if", "else"]}, True),
        ("if time.time() > 0: pass\nelse: pass", {"uses": ["else"]}, False),
        ("if time.time() < 0: colorLeft.rgb", {"uses": ["colorLeft"]}, False),
        ("for x in 'ab':\n    if x == 'a': continue\n    break", {"uses": ["for", "continue", "break"]}, True),
        ("for x in 'ab':\n    if x == 'c': continue\n    if x == 'd': break", {"uses": ["continue", "break"]}, False),
        ("def f():\n    '''Says.'''\n    global n\n    n = 1\n    say('x')\nf()", {"uses": ["say()", "global"]}, True),
        ("from helper import twice\ntwice(lambda: say('x'))", {"uses": ["say()", "for"]}, True),
        ("import helper\nif time.time() < 0: helper.twice(print)", {"uses": ["for"]}, False),
        ("x = [n for n in 'ab']", {"uses": ["comprehension"]}, True),
        ("exec('for n in [1]: say(str(n))')", {"uses": ["for"]}, True),
        ("while True:\n    time.sleep(0.1)", {"uses": ["while"]}, True),
        ("x = 1" + " + 1" * 1500 + "\nwhile time.time() < 0: pass", {"uses": ["while"]}, False),
        ("x = 1" + " + 1" * 1500 + "\nwhile x > 0: break", {"uses": ["while"]}, True),
        ("while True:\n    pass", {"uses": ["while"]}, True),
        ("say('x')\nraise ValueError\nsay('y')", {"uses": ["say()"]}, True),
        ("def say(text): print(text)\nsay('x')", {"uses": ["say()"]}, False),
        ("def say(text): print(text)\nsay('x')", {"uses": ["say()"], "defines": ["say"]}, True),
        ("say = print\nsay('x')", {"uses": ["say()"]}, False),
        ("class Robot:\n    def on(self): pass\nRobot().on()", {"uses": ["on()"]}, False),
        ("class colorLeft: rgb = 1\ncolorLeft.rgb", {"uses": ["colorLeft.rgb"]}, False),
        ("colorLeft = ColorSensor(INPUT_2)\ncolorLeft.rgb", {"uses": ["colorLeft.rgb"]}, True),
        ("from math import floor as MLPClassifier\nMLPClassifier(1)", {"uses": ["MLPClassifier"]}, False),
        ("from helper import twice as say\nsay(print)", {"uses": ["say()"]}, False),
        ("import time as g\nnap = g.sleep\nnap(0.1)", {"uses": ["time.sleep()"]}, True),
    ],
)
def test_only_what_was_run_and_is_not_the_submissions_own_is_used(
    text: str, rules: dict[str, Any], holds: bool, runner: TrialRunner
) -> None:
    result = driven_by(DRIVES + text, runner, **rules)
    assert (result.marks == result.max_marks) is holds, result.message


@pytest.mark.parametrize(
    ("text", "holds"),
    [
        ("from sklearn.neural_network import MLPClassifier\nMLPClassifier()\ndef f(): return 1", True),
        ("def MLPClassifier(): pass\nMLPClassifier()\ndef f(): return 1", False),
        ("from sklearn.neural_network import MLPClassifier as Net\ndef f(): return Net().alpha * 10000", True),
        ("from sklearn import neural_network\ndef f(): return neural_network.MLPClassifier().alpha * 10000", True),
        (
            "from sklearn.neural_network import MLPClassifier\ndef f(a=0):\n    if a: MLPClassifier()\n    return 1",
            False,
        ),
    ],
)
def test_what_a_called_function_uses_is_what_it_ran(text: str, holds: bool, runner: TrialRunner) -> None:
    rule = criterion("source", part="responder", uses=["MLPClassifier"])
    called = criterion("functions", function="f", calls=[{"returns": 1}]).model_copy(update={"id": "f"})
    submission = Submission("ada", responder=SourceFile("responder.py", text))
    result = grade(submission, without_robot(rule, called), runner=runner)
    assert [each.marks == 4 for each in result.criteria] == [holds, True], result.criteria[0].message


@pytest.mark.parametrize(
    ("text", "calls", "holds"),
    [
        ("def f(n):\n    while n: n -= 1\n    return 0", [(1, False), (2, True)], True),
        ("def f(n):\n    if n > 1:\n        while n: n -= 1\n    return 0", [(1, False), (2, True)], False),
        ("def f(n):\n    if n > 1:\n        while n: n -= 1\n    return 0", [(2, True)], True),
        ("def f(n):\n    if n > 9:\n        while n: n -= 1\n    return 0", [(2, True)], True),
    ],
)
def test_rules_about_code_tell_nothing_about_hidden_calls(
    text: str, calls: list[tuple[int, bool]], holds: bool, runner: TrialRunner
) -> None:
    """A construct that runs only for some arguments would otherwise reveal the arguments of hidden calls."""
    rule = criterion("source", part="responder", uses=["while"])
    function_calls = [{"arguments": [number], "returns": 0, "hidden": hidden} for number, hidden in calls]
    called = criterion("functions", function="f", calls=function_calls).model_copy(update={"id": "f"})
    submission = Submission("ada", responder=SourceFile("responder.py", text))
    result = grade(submission, without_robot(rule, called), runner=runner)
    assert [each.marks == 4 for each in result.criteria] == [holds, True], result.criteria[0].message


def test_what_is_run_in_hidden_trials_is_not_looked_at(runner: TrialRunner) -> None:
    dead = f"{DRIVES}while time.time() < 0: say('x')"
    assert driven_by(dead, runner, visibility="hidden", uses=["while"]).marks == 4


def test_looking_at_statements_changes_no_recording(runner: TrialRunner) -> None:
    loop = "for n in range(3):\n    print('PY::', n)\n    say(str(colorLeft.rgb))\n1 / 0"
    text = f"%%sim_magic_preloaded\n{DRIVES}{loop}"
    scenario = Scenario("s", (Pose(200, 600, 0),), seconds=5)
    rules = criterion("source", uses=["for"]), criterion("finishes")
    hashes = [
        grade(
            Submission("ada", program=SourceFile("robot.py", text)),
            Assignment("a", "A", WorldSpec(), Parts("student", "none"), (scenario,), (rule,)),
            runner=runner,
        )
        .trials[0]
        .recording
        for rule in rules
    ]
    assert hashes[0].sha256 == hashes[1].sha256
    assert hashes[0].faults == hashes[1].faults
