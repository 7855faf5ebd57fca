"""Finds the responders that need libraries. Responders run without libraries give the same results as with them."""

from __future__ import annotations

import ast
import json

import pytest

import responders.required_libraries
import responders.trial_spec
from responders.function_calls import FunctionCall
from responders.required_libraries import build_notebook_source, may_need_libraries
from responders.sandbox.inside.libraries import STANDARD_MODULES
from responders.sandbox.roles import ChildRole
from responders.sandbox.running_child import ChildLimits
from responders.source_file import SourceFile
from responders.trial_spec import ResponderSpec
from running import run_program
from service.grading.trial_runner import TrialRunner
from sim.recording import Recording, Verdict

NEEDS_NONE = {
    "nothing": "def responder(text):\n    return text",
    "the standard library": "import json, re\nfrom collections import Counter\nfrom os import path\nre.compile('a')",
    "the course": "from nbev3devsim.load_nbev3devwidget import roboSim, eds",
    "a module beside it": "import helper\nfrom helper import double",
    "in a class": "class A:\n    def __init__(self):\n        super().__init__()\nprint(A.__name__, '{a.b}')",
    "what is said of it": "# import numpy\n'''eval(__import__('numpy'))'''",
}
MAY_NEED = {
    "a library": "import numpy as np",
    "a part of one": "from sklearn.neural_network import MLPClassifier",
    "in a function": "def responder(text):\n    import pandas",
    "the course's": "from nn_tools.sensor_data import zoom_img",
    "its images": "roboSim.image_data()",
    "by a call": "__import__('num' + 'py')",
    "by a module": "import importlib",
    "in code": "exec(text)",
    "in an expression": "eval(text)",
    "by an attribute": "getattr(a, b)(c)",
    "what is loaded": "import sys\nprint('numpy' in sys.modules)",
    "from what is loaded": "from sys import modules as m",
    "matched": "import sys\nmatch sys:\n    case object(modules=found):\n        print(found)",
    "formatted": "import os\nprint('{0.sys.modules}'.format(os))",
    "escaped": "import os\nprint('{0.sys.mod\\x75les}'.format(os))",
    "in another alphabet": "import sys\nsys.ｍodules",
    "classes": "print(().__class__.__base__.__subclasses__())",
    "its end is seen": "class A:\n    def __del__(self):\n        print('gone')",
    "misspelt": "import numppy",
    "relative": "from . import numpy",
    "no Python": "def responder(text)\n",
    "endless": "x = " + "-" * 20_000 + "1",
    "too long to read": "x = 1\n" * 20_000,
    "a magic": "%sim_data",
}
FILES = {"helper.py": b"def double(x):\n    return 2 * x\n", "numbers.csv": b"1,2\n"}
#: The import is assembled at run time.
LATE = """
print(sorted(word for word in ("a", "b")))
with open("helper.py", "w") as file:
    file.write("import numpy\\nseen = numpy.random.rand()\\n")
import helper
print(helper.seen)
def responder(text):
    return str(helper.seen)
"""
FORGED = b'{"n":1,"do":"libraries"}\n'
LOADED = f"""
import importlib, warnings, sys
def names():
    return {{name: sorted(dir(importlib.import_module(name))) for name in {STANDARD_MODULES!r}}}
def settings():
    return [sys.getrecursionlimit(), sys.flags.hash_randomization, sys.getswitchinterval()]
def of_any_warning():
    return [f[0] for f in warnings.filters if f[2] is Warning and f[1] is None and f[3] is None]
"""


@pytest.mark.parametrize("name", NEEDS_NONE)
def test_who_surely_needs_none(name: str) -> None:
    assert not may_need_libraries(NEEDS_NONE[name], FILES)


@pytest.mark.parametrize("name", MAY_NEED)
def test_who_may_need_one(name: str) -> None:
    assert may_need_libraries(MAY_NEED[name], FILES)


@pytest.mark.parametrize(
    "files",
    [{"helper.py": b"import joblib"}, {"helper.py": b"\xff"}, {"_ni_label.py": b""}, {"cython_runtime.py": b""}],
    ids=str,
)
def test_the_files_beside_it_count(files: dict[str, bytes]) -> None:
    assert may_need_libraries("pass", files)


def test_many_modules_are_parsed_once_and_long_ones_never(monkeypatch: pytest.MonkeyPatch) -> None:
    parsed_texts: list[str] = []

    def parse(text: str) -> ast.Module:
        parsed_texts.append(text)
        return ast.parse(text)

    monkeypatch.setattr(responders.required_libraries, "parse_module", parse)
    short_files = {f"m{number}.py": f"x = {number}".encode() for number in range(100)}
    assert [may_need_libraries("pass", short_files) for _ in range(3)] == [False] * 3
    assert len(parsed_texts) == 101
    long_files = {name: data + b"\n" + b"a;" * 500 for name, data in short_files.items()}
    assert may_need_libraries("pass", long_files)
    assert len(parsed_texts) == 101


def test_the_robots_of_a_notebook_do_not_count() -> None:
    cells = ("%%sim_magic_preloaded\nimport numpy", "%sim_magic -R\nimport json", "%load_ext nbev3devsim", "a = 1")
    assert not may_need_libraries(build_notebook_source(cells), {})
    assert may_need_libraries(build_notebook_source((*cells, "%sim_magic {a}")), {})
    assert may_need_libraries(build_notebook_source((*cells, "%%capture\nimport numpy")), {})


def test_what_is_loaded_beside_libraries_is_the_same(runner: TrialRunner, monkeypatch: pytest.MonkeyPatch) -> None:
    calls = [FunctionCall(name) for name in ("names", "settings", "of_any_warning")]

    def read_values(needed: bool) -> list[object]:
        monkeypatch.setattr(responders.trial_spec, "may_need_libraries", lambda *_: needed)
        called = runner.call_functions(_spec(LOADED), calls, 1)
        return [each.value for each in called.returned]

    without = read_values(False)
    assert None not in without
    assert without == read_values(True)


def test_a_library_that_is_imported_after_all_is_as_if_it_had_been_expected(
    runner: TrialRunner, monkeypatch: pytest.MonkeyPatch
) -> None:
    assert _spec(LATE).role == "responder"
    unexpected = _with_responder(runner, LATE)
    monkeypatch.setattr(responders.trial_spec, "may_need_libraries", lambda *_: True)
    expected = _with_responder(runner, LATE)
    assert unexpected.sha256 == expected.sha256
    assert (unexpected.responder_output, unexpected.calls) == (expected.responder_output, expected.calls)
    assert unexpected.verdict is Verdict.FINISHED
    assert json.loads(unexpected.responder_output.split("\n")[-1]) > 0


def test_so_it_is_in_a_robot_program(runner: TrialRunner) -> None:
    late = "import math\nn = __import__('num' + 'py')\nprint(n.random.rand())"
    named = "import numpy as n\nprint(n.random.rand())"
    assert [line.text for line in run_program(runner, late).printed] == [
        line.text for line in run_program(runner, named).printed
    ]


@pytest.mark.parametrize(("role", "text"), [("responder", "pass"), ("responder with libraries", "import numpy")])
def test_who_has_libraries_asks_for_none(role: ChildRole, text: str, runner: TrialRunner) -> None:
    asks = f"{text}\nimport os\nos.write(3, {FORGED!r})\ndef responder(text): return text"
    assert _spec(asks).role == role
    recording = _with_responder(runner, asks)
    assert recording.faults[0].verdict is Verdict.SANDBOX_VIOLATION
    assert "asked for libraries that it has" in recording.faults[0].message


def _spec(text: str) -> ResponderSpec:
    return ResponderSpec(SourceFile("responder.py", text), FILES, ChildLimits(10, 512 << 20), 100_000)


def _with_responder(runner: TrialRunner, text: str) -> Recording:
    program = "import time\nprint('PY::1')\ntime.sleep(1)\nprint('PY::2')\ntime.sleep(1)"
    return run_program(runner, program, responder=text, files=FILES)
