"""The reference responders inside the sandbox: they follow the course's protocol, and survive hostile text."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest

from models import load_weights
from responders import library
from responders.source_file import SourceFile
from running import run_program
from service.grading.grader import grade
from service.grading.trial_runner import TrialRunner
from sim.floors import SHAPES
from sim.recording import Pose, Recording, Verdict
from sim.world import Noise
from submissions.assignment.problems import AssignmentProblems
from submissions.assignment.reader import read_assignment
from submissions.submission import Submission

NETWORK = {
    "mlp_shapes_14x14.joblib": load_weights("shapes"),
    "mlp_digits_14x14.joblib": load_weights("digits"),
}

SAY = """
import time
for text in {texts!r}:
    print(text)
    time.sleep(0.3)
"""


def converse(runner: TrialRunner, name: str, texts: list[str], **options: Any) -> Recording:
    recording = run_program(
        runner,
        SAY.format(texts=texts),
        responder=library.source(f"{name}.py"),
        files=NETWORK,
        preamble="none",
        **options,
    )
    assert recording.verdict is Verdict.FINISHED, recording.faults
    return recording


def answers(recording: Recording) -> list[Any]:
    """Return the responder's answers, unwrapped if they are JSON."""
    texts = [message.text for message in recording.messages if message.sender == "responder"]
    return [json.loads(text[6:])["message"] if text.startswith("JSON::") else text for text in texts]


TEXTS = [
    "PY::1",
    "PY:: [1, 2]",
    "PY:: {'int': 1}",
    "PY::my message",
    "PY::__import__('os').getcwd()",
    "PY::" + "(" * 500,
]


def test_echo_evaluates_literals_and_nothing_else(runner: TrialRunner) -> None:
    recording = converse(runner, "echo_responder", TEXTS)
    assert answers(recording) == [
        f"Python saw >> {seen} << that..."
        for seen in ("1", "[1, 2]", "{'int': 1}", "my message", "__import__('os').getcwd()", "(" * 500)
    ]
    assert recording.responder_log.count("---") == len(TEXTS)


def test_json_wraps_the_agents_answer(runner: TrialRunner) -> None:
    assert answers(converse(runner, "json_responder", TEXTS[:3])) == [
        "Py saw: 1",
        "Py saw: [1, 2]",
        "Py saw: {'int': 1}",
    ]


def test_image_parser_says_which_kind(runner: TrialRunner) -> None:
    text, image = answers(converse(runner, "image_parser", ["PY::{'test_key':'test value'}", "IMG_DATA"]))
    assert text == "Py saw: {'typ': 'PY', 'obj': {'test_key': 'test value'}}"
    assert image.startswith("Py saw: {'typ': 'IMG_DATA', 'obj': {'left': '245,226,225,255,")


@pytest.mark.long
@pytest.mark.parametrize("name", ["shape_responder", "rule_responder"])
@pytest.mark.parametrize("code", range(6))
def test_shapes_are_named_in_the_courses_poses_and_a_millimetre_off(runner: TrialRunner, name: str, code: int) -> None:
    for dx, dy, noise in ((0, 0, 0.0), (1, -1, 0.0), (-1, 1, 32.0), (0, 1, 10.0)):
        recording = converse(
            runner,
            name,
            ["IMG_DATA"],
            start=Pose(200 + 80 * code + dx, 900 + dy, 0),
            background="Simple_Shapes",
            noise=Noise(light=noise),
        )
        shape = SHAPES[code]
        assert answers(recording) == [{"report": f"Agent says: I saw {shape}", "shape": shape}], (dx, dy, noise)
        assert recording.images[0].truth == shape


def test_the_unlabelled_row_is_named_too(runner: TrialRunner) -> None:
    for column, code in enumerate((1, 5, 0, 2)):
        recording = converse(
            runner, "rule_responder", ["IMG_DATA"], start=Pose(200 + 80 * column, 700, 0), background="Simple_Shapes"
        )
        assert answers(recording)[0]["shape"] == SHAPES[code]


@pytest.mark.parametrize("name", ["shape_responder", "rule_responder"])
def test_texts_get_an_answer_without_a_shape(runner: TrialRunner, name: str) -> None:
    assert answers(converse(runner, name, ["PY::hello", "PY::3"])) == [
        {"report": "Agent says: I heard hello"},
        {"report": "Agent says: I heard 3"},
    ]


def test_an_empty_floor_is_no_shape(runner: TrialRunner) -> None:
    recording = converse(runner, "rule_responder", ["IMG_DATA"], noise=Noise(light=32.0))
    assert answers(recording) == [{"report": "Agent says: I see no shape"}]


def test_the_library_gives_only_its_own_files() -> None:
    assert all(library.source(name).startswith('"""') for name in library.names())
    with pytest.raises(KeyError):
        library.source("../kit/nn_tools/sensor_data")


@pytest.mark.long
@pytest.mark.parametrize("name", ["digit_responder", "plain_digit_responder"])
def test_digits_of_a_sheet_are_named(runner: TrialRunner, name: str) -> None:
    right = 0
    for column in range(10):
        recording = run_program(
            runner,
            SAY.format(texts=["IMG_DATA"]),
            Pose(100 + 100 * column, 1050, 90),
            responder=library.source(f"{name}.py"),
            files=NETWORK,
            background="MNIST_Digits",
            preamble="none",
        )
        (answer,) = answers(recording)
        right += str(answer["digit"]) == recording.images[0].truth
    assert right >= 9


def test_the_digit_responder_says_how_sure_it_is_and_sees_paper_as_paper(runner: TrialRunner) -> None:
    sheet = {"background": "MNIST_Digits", "start": Pose(100, 1050, 90)}
    (answer,) = answers(converse(runner, "digit_responder", ["IMG_DATA"], **sheet))
    assert 0.5 < answer["confidence"] <= 1
    assert answers(converse(runner, "digit_responder", ["IMG_DATA"], noise=Noise(light=64))) == [
        {"report": "Agent says: I see no digit"}
    ]
    assert answers(converse(runner, "digit_responder", ["PY::hello"])) == [{"report": "Agent says: I heard hello"}]


GIVES = """
id = "given"
title = "Given"
[parts]
responder = "{name}"
[[scenario]]
id = "s"
seconds = 2
[[criterion]]
title = "Ends"
marks = 1
check = "finishes"
"""


@pytest.mark.parametrize("name", library.names())
def test_an_assignment_gives_one_by_its_name(tmp_path: Path, name: str) -> None:
    (tmp_path / "assignment.toml").write_text(GIVES.format(name=name))
    packaged = read_assignment(tmp_path)
    (tmp_path / name).write_text("def responder(message): return 'mine'")
    own = read_assignment(tmp_path)
    assert packaged.given_parts == {name: library.source(name)}
    assert own.given_parts == {name: "def responder(message): return 'mine'"}
    assert packaged.version != own.version


def test_a_given_one_answers_the_students_program(tmp_path: Path, runner: TrialRunner) -> None:
    (tmp_path / "assignment.toml").write_text(GIVES.format(name="echo_responder.py"))
    program = SourceFile("robot.py", "import time\nprint('PY::[1, 2]')\ntime.sleep(1)")
    result = grade(Submission("ada", program), read_assignment(tmp_path), runner=runner)
    assert answers(result.trials[0].recording) == ["Python saw >> [1, 2] << that..."]


def test_the_sentence_on_another_name_lists_them(tmp_path: Path) -> None:
    (tmp_path / "assignment.toml").write_text(GIVES.format(name="eco_responder.py"))
    with pytest.raises(AssignmentProblems, match=r'responder is "eco_responder.py", expected .*echo_responder\.py'):
        read_assignment(tmp_path)
