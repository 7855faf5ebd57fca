"""The course notebook on messaging: its programs and responders, unchanged, behave as it says."""

from __future__ import annotations

import pytest

from models import weights_bytes
from running import run_program
from service.grading.trial_runner import TrialRunner
from sim.recording import Pose, Recording, Verdict
from submissions.assignment.examples import examples
from submissions.magics import setup, split_program

NETWORK = {"mlp_shapes_14x14.joblib": weights_bytes("shapes")}
SHAPES = (
    "square",
    "right facing triangle",
    "left facing triangle",
    "downwards facing triangle",
    "upwards facing triangle",
    "diamond",
)


def driven(runner: TrialRunner, name: str, start: Pose | None = None) -> Recording:
    grading_request = examples(name) / "seed"
    flags, text = split_program((grading_request / "robot.py").read_text())
    chosen = setup(flags)
    return run_program(
        runner,
        text,
        start or chosen.pose,
        background=chosen.background,
        responder=(grading_request / "responder.py").read_text(),
        files=NETWORK,
    )


def test_echo(runner: TrialRunner) -> None:
    recording = driven(runner, "echo-responder")
    assert [(message.sender, message.text) for message in recording.messages] == [
        line
        for number in (0, 2, 4)
        for line in (("robot", f"PY::{number}"), ("responder", f"Python saw >> {number} << that..."))
    ]
    assert [line.text for line in recording.spoken] == ["all done"]
    assert recording.responder_log.count("---") == 3
    assert recording.responder_log.startswith("Received message: 0\nResponse: Python saw >> 0 << that...\n")
    assert recording.verdict is Verdict.FINISHED


def test_json(runner: TrialRunner) -> None:
    recording = driven(runner, "json-queue")
    queues = [line.text for line in recording.printed if line.text.startswith("Message queue")]
    assert [queue.count("Py saw") for queue in queues] == [0, 1, 1, 2, 2, 3]
    assert recording.spoken[-1].text == "Last Python message was ...Py saw: 4"
    assert "Received message: PY::4" in recording.responder_log
    assert recording.verdict is Verdict.FINISHED


def test_image_data(runner: TrialRunner) -> None:
    recording = driven(runner, "image-parser")
    answers = [message.text for message in recording.messages if message.sender == "responder"]
    assert answers[0] == """JSON::{"message": "Py saw: {'typ': 'PY', 'obj': {'test_key': 'test value'}}"}"""
    assert answers[1].startswith("""JSON::{"message": "Py saw: {'typ': 'IMG_DATA', 'obj': {'left': '245,226,225,255,""")
    assert recording.verdict is Verdict.FINISHED


def test_shape_from_520_900(runner: TrialRunner) -> None:
    recording = driven(runner, "shape-recognition")
    assert recording.spoken[-1].text == "Is that a upwards facing triangle"
    assert [(call.caller, call.callee) for call in recording.calls] == [
        ("responder", "parser"),
        ("agent", "MLP"),
        ("responder", "agent"),
        ("responder", "logger"),
    ]


@pytest.mark.parametrize(("number", "shape"), list(enumerate(SHAPES)))
def test_every_shape(runner: TrialRunner, number: int, shape: str) -> None:
    recording = driven(runner, "shape-recognition", Pose(200 + 80 * number, 900, 0))
    assert recording.spoken[-1].text == f"Is that a {shape}"
    assert recording.images[0].truth == shape
