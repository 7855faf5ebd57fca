"""Criteria about code: texts read and functions called inside the sandbox, and checks of the instructor's in Python."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from judging import criterion
from responders.code import Code
from responders.function_calls import FunctionCall, call_functions
from responders.sandbox.meter import JobMeter
from responders.sandbox.running_child import ChildLimits
from service.grading.grade import Grade
from service.grading.grader import grade
from service.grading.judging.code import judge_source
from service.grading.judging.outcome import Outcome
from service.grading.judging.source_answers import SourceAnswers
from service.grading.run_plan import plan_run
from service.grading.static_analysis import analyse
from service.grading.trial_runner import TrialRunner
from service.reports.formats.text import plain_text
from service.reports.view import staff_view, student_view
from sim.recording import Verdict
from submissions.assignment.definition import Assignment, Limits, Parts, WorldSpec
from submissions.assignment.problems import AssignmentProblems
from submissions.assignment.reader import read_assignment
from submissions.criteria import Criterion
from submissions.magics import split_program
from submissions.plain_cells import python_of
from submissions.submission import Cell, Notebook, Submission

LIMITS = ChildLimits(1.0, 256 << 20)


def without_robot(*criteria: Criterion) -> Assignment:
    return Assignment("a", "A", WorldSpec(), Parts("none", "student"), (), criteria)


def answers(text: str, runner: TrialRunner, **rules: Any) -> SourceAnswers:
    asked = Assignment("a", "A", WorldSpec(), Parts("student", "none"), (), (criterion("source", **rules),))
    plan = plan_run(Submission("ada", program=Code("robot.py", text)), asked)
    return analyse(plan, (), runner, JobMeter()).answers["c"]


def judged(text: str, runner: TrialRunner, **rules: Any) -> Outcome:
    flags, program = split_program(text)
    return judge_source(criterion("source", **rules), answers(program, runner, **rules), flags)  # type: ignore[arg-type]


def graded(text: str, runner: TrialRunner, *criteria: Criterion) -> Grade:
    submission = Submission("ada", responder=Code("responder.py", text))
    return grade(submission, without_robot(*criteria), runner=runner)


# what the text has

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
        ({"in_loop": ["square()", "on_for_rotations()"]}, True),
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
        "Expected your program to do without a while loop, but line 11 has it. "
        "Expected your program to do without say(), but line 10 has it."
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
    found = answers(text, runner, avoids=["say()", "import time"], uses=["for"])
    assert error in found.error
    assert bool(found.error) is bool(error)


def test_what_is_avoided_cannot_be_hidden_behind_many_names(runner: TrialRunner) -> None:
    many = "\n".join(f"name_{i}({i})" for i in range(9_000))
    assert judged(many, runner, avoids=["eval()"]).passed
    assert "line 9001 has it" in judged(f"{many}\neval('1')", runner, avoids=["eval()"]).message


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
    assert line is None or f"line {line} has it" in outcome.message


def test_what_a_text_cannot_show_is_told_to_staff(runner: TrialRunner) -> None:
    outcome = judged("x = 1\nexec(''.join(['s', 'ay(1)']))", runner, avoids=["say()"])
    assert outcome.passed
    assert outcome.message == "The text of your program is as expected."
    assert outcome.for_staff == "Can do more than its text shows: line 2 has exec."


@pytest.mark.parametrize(
    ("helper", "words"),
    [
        ("import math\nfrom sklearn import svm", "line 2 of helper.py has it"),
        ("x = 1\n" * 60_000, "helper.py cannot be read: it has more than 300000 characters"),
        ("print 'this was never Python 3'", ""),
        ("import math", ""),
    ],
)
def test_files_beside_the_responder_are_read_too(helper: str, words: str, runner: TrialRunner) -> None:
    rules = criterion("source", part="responder", avoids=["import sklearn"])
    submission = Submission(
        "ada",
        responder=Code("responder.py", "import helper\ndef responder(text): return text"),
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
    "told",
    [
        *(None, 3, [], {}, {"unread": None}),
        *(SOUND | {"uses": uses} for uses in ([], [None, None], [3], [["x"]], [["x", "y"]], None)),
        *(SOUND | {"doubts": doubts} for doubts in ([1], [["", "x", ""]], None)),
        *(SOUND | {"unread": unread} for unread in (["x"], ["", "", "x"], 3)),
    ],
)
def test_nonsense_from_the_reader_is_no_answer(told: Any) -> None:
    rules = criterion("source", uses=["for"])
    assert SourceAnswers.read(SOUND, rules).uses  # type: ignore[arg-type]
    assert SourceAnswers.read(told, rules).error == "it cannot be read"  # type: ignore[arg-type]


def test_text_of_a_notebook_is_its_plain_cells() -> None:
    cells = (
        "%%sim_magic_preloaded\nsay('x')",
        "import re\n%matplotlib inline",
        "if re:\n    !ls\n",
        "%%writefile a\nx",
        "%%capture out\nimport math\n%time import json",
    )
    notebook = Notebook("a.ipynb", tuple(Cell(number, text) for number, text in enumerate(cells, 1)))
    text = python_of(notebook)
    compile(text, "a", "exec")
    assert "say" not in text
    assert "import re" in text
    assert "import math\nimport json" in text


# what functions return


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


# checks in Python

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
    program = Code("robot.py", "print('Light_left: 3 1')\ntank_drive.on_for_seconds(50, 50, 1)\nsay('x')")
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
    program = Code("robot.py", f"print('Light_left: {value}')\n" * 3)
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
    assert result.message == "This could not be judged; staff will look at it."
    assert re.search(words, result.unjudged)
    assert result.unjudged in result.for_staff


#: A check that takes on trust what it reads, beside a line that anybody earns who comes to the end.
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


@pytest.mark.parametrize("text", MISLEADING, ids=lambda text: text[:12])
def test_no_text_of_a_students_ends_the_job_by_way_of_a_check(
    text: str, trusting: Assignment, runner: TrialRunner
) -> None:
    result = grade(Submission("ada", Code("robot.py", f"print({text!r})")), trusting, runner=runner)
    asked, ended = result.criteria
    assert asked.marks == 0
    assert asked.unjudged
    assert ended.marks == 2
    assert not ended.unjudged
    told = plain_text(staff_view(result))
    assert "For staff: Could not be judged: " in told
    shown = plain_text(student_view(result))
    assert "This could not be judged; staff will look at it." in shown
    assert asked.unjudged[:30] not in shown


def test_a_check_has_what_it_needs_when_the_submission_has_used_up_its_own(
    trusting: Assignment, runner: TrialRunner
) -> None:
    few = replace(trusting, limits=replace(trusting.limits, all_cpu=0.5))
    program = Code("robot.py", "print('json [1]')\nwhile True: pass")
    asked, ended = grade(Submission("ada", program), few, runner=runner).criteria
    assert ended.marks == 0
    assert not asked.unjudged
    assert asked.evidence[0].passed


# what does not fit together


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (
            ('check = "python"\nfile = "check.py"', 'check = "functions"\ncalls = [{ arguments = [3] }]'),
            "neither returns nor one_of",
        ),
        (('title = "A"', 'title = "A"\ngiven = ["check.py"]'), r'given names "check\.py", which holds answers'),
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
