"""Programs whose output depends on hashes and addresses get the same marks and recordings in every process."""

from __future__ import annotations

import json
import os
import subprocess
import sys
import textwrap
from pathlib import Path

import pytest

from paths import HELPERS
from responders.source_file import SourceFile
from service.grading.grader import grade
from service.grading.trial_runner import TrialRunner
from submissions.assignment.reader import find_assignment
from submissions.submission import Submission

#: The first output of each program decides its marks: "TM129", spoken letter by letter or as a word.
_FIRST = "for word in {}: say(word); break"
BY_HASH = (
    _FIRST.format('{"T M 1 2 9", "TM129"}'),
    _FIRST.format('frozenset(["TM129", "T M 1 2 9", "T-M-1-2-9"])'),
    _FIRST.format('sorted({"T M 1 2 9", "TM129"}, key=hash)'),
    _FIRST.format('set("TM129")'),
    _FIRST.format('{b"TM129".decode(), "T M 1 2 9"} - {"x"}'),
    'say("TM129" if hash("TM129") % 2 else "T M 1 2 9")',
    'say("TM129" if hash(("a", 1)) % 2 else "T M 1 2 9")',
    'from datetime import date\nsay("TM129" if hash(date(2020, 1, 1)) % 2 else "T M 1 2 9")',
    'import random\nsay(random.Random().choice(["TM129", "T M 1 2 9"]))',
    'import random\nrandom.seed()\nsay(random.choice(["TM129", "T M 1 2 9"]))',
    'import os\nsay("TM129" if os.urandom(1)[0] % 2 else "T M 1 2 9")',
    'import secrets\nsay(secrets.choice(["TM129", "T M 1 2 9"]))',
    'import numpy\nsay(numpy.random.default_rng().choice(["TM129", "T M 1 2 9"]))',
    'import time\nsay("TM129" if time.clock_gettime_ns(0) % 2 else "T M 1 2 9")',
)
BY_ADDRESS = (
    'class A: pass\nfor each in sorted([A() for _ in range(50)], key=id)[:3]: print(id(each))\nsay("TM129")',
    'things = {object(): number for number in range(50)}\nprint(sorted(things, key=hash)[0])\nsay("TM129")',
    'class A:\n    pass\na = [A(), A()]\nfor each in set(a): say(["TM129", "T M 1 2 9"][a.index(each)]); break',
    'say("TM129" if hash(None) % 2 else "T M 1 2 9")',
    'print(object())\nsay("TM129" if id([]) // 16 % 2 else "T M 1 2 9")',
    'import numpy\nprint(id(numpy.zeros(9)), numpy.zeros(9).ctypes.data)\nsay("TM129")',
)


def _graded(runner: TrialRunner) -> list[list[object]]:
    """Return the marks and hashes that must be equal."""
    programs = BY_HASH + BY_ADDRESS * ("fixed addresses" in runner.check_sandbox())
    assignment = find_assignment("say-tm129")
    grades = [grade(Submission("ada", SourceFile("robot.py", text)), assignment, runner=runner) for text in programs]
    return [[str(each.marks), *(trial.recording.sha256 for trial in each.trials)] for each in grades]


_ELSEWHERE = textwrap.dedent("""
    import json
    from service.grading.trial_runner import TrialRunner
    from test_same_marks_in_any_process import _graded
    with TrialRunner() as runner:
        print(json.dumps(_graded(runner)))
""")


@pytest.mark.long
def test_three_fresh_processes_give_the_same_marks_and_hashes() -> None:
    path = os.pathsep.join([str(HELPERS), str(Path(__file__).parent)])
    results = []
    for number in range(3):
        environment = os.environ | {"PYTHONPATH": path, "PYTHONHASHSEED": str(number)}
        ran = subprocess.run(
            [sys.executable, "-c", _ELSEWHERE], env=environment, capture_output=True, text=True, check=True
        )
        results.append(json.loads(ran.stdout))
    assert all(each == results[0] for each in results)
    assert len({marks for marks, *_ in results[0]}) > 1
