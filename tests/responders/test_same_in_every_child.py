"""Children of every kind have the same hashes, order, random numbers and addresses on every worker."""

from __future__ import annotations

import ast
import contextlib
import os
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import graded_notebooks
from responders.function_calls import FunctionCall
from responders.sandbox.running_child import ChildLimits
from responders.source_file import SourceFile
from responders.training import TrainingSpec
from responders.trial_spec import ResponderSpec
from running import run_program
from service.grading.grader import grade
from service.grading.trial_runner import TrialRunner
from sim.recording import Recording
from submissions.assignment.reader import read_assignment
from submissions.submission import Submission

#: Values that a child reports: first those that follow from hashes, seeds and clocks, then those from addresses.
TOLD = """
def told():
    import gc, os, random, sys, tempfile, time, timeit, uuid
    class Thing:
        pass
    names = {"T M 1 2 9", "TM129", "robot", "responder", "\\u00e9"}
    texts = [hash("a"), hash(("a", 1.5)), list(names), sys.flags.hash_randomization]
    texts += [random.random(), random.Random().random(), os.urandom(4).hex(), uuid.uuid4().hex, uuid.uuid1().node]
    random.seed()
    texts += [random.random(), next(tempfile._get_candidate_names()), time.time(), time.clock_gettime(0)]
    texts += [time.clock_gettime_ns(1), list(os.times()), timeit.default_timer()]
    if "numpy" in sys.modules:
        import numpy
        texts += [float(numpy.random.random()), float(numpy.random.default_rng().random())]
        texts += [float(numpy.random.RandomState().rand()), numpy.sin(numpy.arange(50.0)).tobytes().hex()[:60]]
    things = {Thing() for _ in range(30)}
    places = [hash(None), hash(len), id(Thing()), id([]), id(bytes(300)), id(bytes(5000)), id(told)]
    places += [id(sys._getframe()), [id(each) for each in things], gc.get_count(), object.__repr__(names)]
    return [texts, places]
"""
ANSWERS = "def responder(text):\n    return str(told())\n"
ASKS = "import time\nprint('PY::x')\ntime.sleep(1)\n"
LIMITS = ChildLimits(5.0, 512 << 20)


def _answer(recording: Recording) -> str:
    assert recording.faults == ()
    return next(message.text for message in recording.messages if message.sender == "responder")


def _robot(text: str) -> Callable[[TrialRunner, Path], str]:
    return lambda runner, _: run_program(runner, text + TOLD + "print(told())").printed[-1].text


def _responder(text: str) -> Callable[[TrialRunner, Path], str]:
    return lambda runner, _: _answer(run_program(runner, ASKS, responder=text + TOLD + ANSWERS))


def _agent(runner: TrialRunner, _: Path) -> str:
    agents = {"agent": TOLD + "def agent(text):\n    return told()\n"}
    responder = "def responder(text):\n    return str(agent(text))\n"
    return _answer(run_program(runner, ASKS, responder=responder, agents=agents))


def _notebook(runner: TrialRunner, folder: Path) -> str:
    cells = [TOLD + ANSWERS, graded_notebooks.PROGRAM]
    return _answer(graded_notebooks.recorded(folder, runner, cells))


def _function(runner: TrialRunner, _: Path) -> str:
    module = ResponderSpec(SourceFile("responder.py", TOLD), {}, LIMITS, 100_000)
    return str(runner.call_functions(module, [FunctionCall("told")], seed=1).returned[0].value)


def _training(runner: TrialRunner, _: Path) -> str:
    model = "class Model:\n    def predict(self, rows): return ['a'] * len(rows)\n"
    code = SourceFile(
        "responder.py", f"{TOLD}{model}def train(images, labels):\n    print(told())\n    return Model()\n"
    )
    images = np.zeros((2, 14, 14), np.uint8)
    spec = TrainingSpec(code, {}, "train", images, ["a", "b"], [images], LIMITS, 100_000, 1)
    return runner.train(spec)[0].output


def _check(runner: TrialRunner, folder: Path) -> str:
    criteria, parts = "", ((0, 0), (0, 400), (1, 0), (1, 400))
    for number, (part, start) in enumerate(parts):
        says = f"{{'passed': True, 'message': repr(told()[{part}])[{start}:{start + 400}]}}"
        (folder / f"check{number}.py").write_text(f"{TOLD}def check(trial):\n    return {says}\n")
        criteria += (
            f'[[criterion]]\nid = "c{number}"\ntitle = "C"\nmarks = 4\ncheck = "python"\nfile = "check{number}.py"\n'
        )
    (folder / "assignment.toml").write_text(
        'id = "a"\ntitle = "A"\n[parts]\nresponder = "none"\n[[scenario]]\nid = "s"\nposes = [[100, 800, 0]]\n'
        f"seconds = 5\n{criteria}"
    )
    submission = Submission("ada", SourceFile("robot.py", "say('x')"))
    given = grade(submission, read_assignment(folder), runner=runner)
    messages = [each.evidence[0].message for each in given.criteria]
    return repr([messages[:2], messages[2:]])


KINDS: dict[str, Callable[[TrialRunner, Path], str]] = {
    "robot program": _robot(""),
    "robot program with libraries": _robot("import numpy\n"),
    "responder": _responder(""),
    "responder with libraries": _responder("import sklearn\n"),
    "agent": _agent,
    "notebook": _notebook,
    "function call": _function,
    "training": _training,
    "check": _check,
}


@pytest.fixture(scope="module")
def recorded_answers(tmp_path_factory: pytest.TempPathFactory) -> tuple[bool, dict[str, list[list[Any]]]]:
    """Return whether addresses are fixed here, and the reports of children of each kind.

    The two children of each kind come from zygotes with different histories, in a process with other open files.
    """
    answers: dict[str, list[list[Any]]] = {kind: [] for kind in KINDS}
    for kinds, files in ((list(KINDS), 0), (list(reversed(KINDS)), 100)):
        with contextlib.ExitStack() as opened, TrialRunner() as runner:
            for _ in range(files):
                opened.enter_context(Path(os.devnull).open())
            fixed = "fixed addresses" in runner.check_sandbox()
            for kind in kinds * 2:
                answers[kind].append(ast.literal_eval(KINDS[kind](runner, tmp_path_factory.mktemp("kind"))))
    return fixed, answers


@pytest.mark.long
@pytest.mark.parametrize("kind", KINDS)
def test_it_is_the_same_in_two_fresh_zygotes_and_in_the_next_child(
    kind: str, recorded_answers: tuple[bool, dict[str, list[list[Any]]]]
) -> None:
    fixed, answers = recorded_answers
    texts, places = zip(*answers[kind], strict=True)
    assert all(each == texts[0] for each in texts)
    # If the machine cannot fix addresses, the grade does not list this layer.
    assert not fixed or all(each == places[0] for each in places)
