"""Models in submissions: good ones are marked, bad ones get a verdict and a sentence and affect nothing else."""

from __future__ import annotations

import base64
import importlib
import io
import os
import pickle
import re
import socket
import sys
import tomllib
import zipfile
from collections.abc import Callable, Iterator, Mapping
from decimal import Decimal
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np
import pytest

from model_submissions_maker import FOLDER, TRACE, grading_requests
from models import load_weights
from models.perceptrons import load_perceptron
from paths import DATA, ROOT
from running import run_program
from service.grading.grade import Grade
from service.grading.grader import grade
from service.grading.trial_runner import TrialRunner
from sim.errors import UsageError
from sim.recording import Verdict
from submissions.assignment.reader import find_assignment
from submissions.bundle import read_submission

EXPECTED: Mapping[str, Mapping[str, Any]] = tomllib.loads((FOLDER / "expected.toml").read_text())
KIT = ROOT / "responders" / "kit"

ASK_ONCE = 'import time\nprint("PY::now")\ntime.sleep(1)\n'
LOAD = 'import joblib\nnetwork = joblib.load("model.joblib")\ndef responder(text): return str(network)\n'


def graded(folder: Path, runner: TrialRunner) -> Grade:
    assignment = find_assignment(str(FOLDER))
    return grade(read_submission(folder, required_parts=assignment.parts), assignment, runner=runner)


#: A long test: the file takes seconds to write and to read.
_LARGE = "weights-of-two-gigabytes"


@pytest.mark.long
@pytest.mark.parametrize(
    "name", [pytest.param(name, marks=[pytest.mark.long] * (name == _LARGE)) for name in sorted(EXPECTED)]
)
def test_a_model_gets_marks_or_a_sentence(name: str, runner: TrialRunner) -> None:
    wanted = EXPECTED[name]
    result = graded(FOLDER / name, runner)
    messages = "\n".join(criterion.message for criterion in result.criteria)
    assert (str(result.verdict), result.marks) == (wanted["verdict"], Decimal(wanted["marks"])), messages
    for phrase in wanted["feedback"]:
        assert phrase in messages
    noted = "\n".join(note for trial in result.trials for note in trial.recording.notes)
    for phrase in wanted.get("notes", ()):
        assert phrase in noted
    assert not Path(TRACE).exists()


def test_every_submission_with_a_model_has_an_expectation() -> None:
    assert {path.name for path in FOLDER.iterdir() if path.is_dir()} == set(EXPECTED)


def test_a_session_of_the_students_own_has_one_thread(runner: TrialRunner) -> None:
    text = (
        "import onnxruntime, numpy\noptions = onnxruntime.SessionOptions()\noptions.intra_op_num_threads = 4\n"
        'session = onnxruntime.InferenceSession("shapes.onnx", options)\n'
        'def responder(text): return str(session.run(None, {"image": numpy.ones((1, 1, 14, 14), "f4")})[0].shape)\n'
    )
    files = {"shapes.onnx": (FOLDER / "convolution" / "shapes.onnx").read_bytes()}
    recording = run_program(runner, ASK_ONCE, responder=text, files=files, preamble="none")
    assert recording.verdict is Verdict.FINISHED, recording.faults
    assert recording.messages[-1].text == "(1, 6)"


#: An ONNX file whose only operator is RandomNormalLike, without a seed: input x, output y, each of shape (1, 4).
RANDOM_OPERATOR = base64.b64decode(
    "CAgSAXg6RwoYCgF4EgF5IhBSYW5kb21Ob3JtYWxMaWtlEgFnWhMKAXgSDgoMCAESCAoCCAEKAggEYhMKAXkSDgoMCAESCAoCCAEKAggEQgQKABAR"
)
USES_RANDOM_OPERATOR = f"""
import base64, numpy, onnxruntime
session = onnxruntime.InferenceSession(base64.b64decode({base64.b64encode(RANDOM_OPERATOR)!r}))
def draw(): return str(session.run(None, {{"x": numpy.ones((1, 4), "f4")}})[0].tolist())
"""


@pytest.mark.parametrize(
    ("program", "responder"),
    [
        (f"{USES_RANDOM_OPERATOR}print(draw())", None),
        (ASK_ONCE, f"{USES_RANDOM_OPERATOR}def responder(_): return draw()"),
    ],
    ids=["robot program", "responder"],
)
def test_random_operators_of_a_network_give_the_same_numbers_in_every_run(
    program: str, responder: str | None, runner: TrialRunner
) -> None:
    first, second, other = (
        run_program(runner, program, responder=responder, preamble="none", seed=seed) for seed in (1, 1, 2)
    )
    numbers, *others = (
        (each.messages[-1] if each.messages else each.printed[-1]).text for each in (first, second, other)
    )
    assert numbers.startswith("[["), first.faults
    assert (others[0] == numbers, others[1] == numbers) == (True, False)
    assert first.sha256 == second.sha256


@pytest.mark.parametrize("file", ["digits.tflite", "digits-quantized.tflite"])
@pytest.mark.parametrize(
    "text",
    [
        "from nn_tools.network_views import cnn_load, cnn_test_with_image\nfrom PIL import Image\n"
        'cnn = cnn_load("net.tflite", None)\n'
        'def responder(text): return str(cnn_test_with_image(cnn, Image.new("L", (14, 14)), retval=True).shape)\n',
        "from ai_edge_litert.interpreter import Interpreter\nnet = Interpreter('net.tflite', num_threads=4)\n"
        "net.allocate_tensors()\nimport numpy\nasked = net.get_input_details()[0]\n"
        "net.set_tensor(asked['index'], numpy.zeros(asked['shape'], asked['dtype']))\nnet.invoke()\n"
        "def responder(text): return str(net.get_tensor(net.get_output_details()[0]['index'])[0].shape)\n",
    ],
    ids=["by the kit", "an interpreter of one's own with four threads"],
)
def test_a_tensorflow_lite_network_runs_in_the_sandbox(runner: TrialRunner, file: str, text: str) -> None:
    files = {"net.tflite": (DATA / "tensorflow_lite" / file).read_bytes()}
    recording = run_program(runner, ASK_ONCE, responder=text, files=files, preamble="none")
    assert recording.verdict is Verdict.FINISHED, recording.faults
    assert recording.messages[-1].text == "(10,)"


@pytest.mark.parametrize(
    ("change", "sentence"),
    [
        (lambda data: b"<!DOCTYPE html>", "net.tflite cannot be read as a network in TensorFlow Lite's format"),
        (lambda data: data[:2000], "net.tflite cannot be read as a network in TensorFlow Lite's format"),
        (lambda data: b"", "net.tflite cannot be read as a network in TensorFlow Lite's format"),
        (lambda data: data, "this network is for images of shape [1, 28, 28, 1], but was shown one of (28, 28, 3)"),
    ],
    ids=["a web page", "cut off", "empty", "an image in colour"],
)
def test_a_bad_tensorflow_lite_file_or_image_gets_a_sentence(
    runner: TrialRunner, change: Callable[[bytes], bytes], sentence: str
) -> None:
    text = (
        "from nn_tools.network_views import cnn_load, cnn_test_with_image\nfrom PIL import Image\n"
        'cnn = cnn_load("net.tflite", None)\n'
        'def responder(text): return str(cnn_test_with_image(cnn, Image.new("RGB", (14, 14))))\n'
    )
    files = {"net.tflite": change((DATA / "tensorflow_lite" / "digits.tflite").read_bytes())}
    recording = run_program(runner, ASK_ONCE, responder=text, files=files, preamble="none")
    assert recording.verdict is Verdict.RESPONDER_ERROR
    assert sentence in recording.faults[0].message


@pytest.mark.long
def test_a_damaged_tensorflow_lite_file_never_harms_more_than_its_responder(runner: TrialRunner) -> None:
    good = (DATA / "tensorflow_lite" / "digits.tflite").read_bytes()
    text = (
        'from nn_tools.network_views import cnn_load\ncnn_load("net.tflite", None)\ndef responder(text): return "ok"\n'
    )
    chance = np.random.default_rng(5)
    for _ in range(200):
        data = bytearray(good)
        for place in chance.integers(8, len(good), chance.integers(1, 40)):
            data[place] = chance.integers(256)
        files = {"net.tflite": bytes(data)}
        recording = run_program(runner, ASK_ONCE, responder=text, files=files, preamble="none")
        assert recording.verdict in (Verdict.FINISHED, Verdict.RESPONDER_ERROR), recording.faults
    files = {"net.tflite": good}
    after = run_program(runner, ASK_ONCE, responder=text, files=files, preamble="none")
    assert after.messages[-1].text == "ok"


class Calls:
    """Becomes a call when it is unpickled."""

    def __init__(self, function: Callable[..., Any], *args: Any) -> None:
        self._call = function, args

    def __reduce__(self) -> tuple[Callable[..., Any], tuple[Any, ...]]:
        return self._call


@pytest.mark.parametrize("deed", ["writes a file", "reads a file", "deletes a file", "ends its parent", "connects"])
def test_a_hostile_pickle_touches_nothing_outside(deed: str, runner: TrialRunner, tmp_path: Path) -> None:
    victim = tmp_path / "victim.txt"
    victim.write_text("secret")
    with socket.create_server(("127.0.0.1", 0)) as listening:
        listening.settimeout(0.2)
        calls = {
            "writes a file": Calls(Path.write_text, victim, "changed"),
            "reads a file": Calls(Path.read_text, victim),
            "deletes a file": Calls(os.unlink, str(victim)),
            "ends its parent": Calls(exec, "import os; os.kill(os.getppid(), 9)"),
            "connects": Calls(socket.create_connection, listening.getsockname()),
        }
        files = {"model.joblib": pickle.dumps(calls[deed])}
        recording = run_program(runner, ASK_ONCE, responder=LOAD, files=files, preamble="none")
        with pytest.raises(TimeoutError):
            listening.accept()
    assert recording.verdict is Verdict.RESPONDER_ERROR
    # If bubblewrap works too, the file does not even exist in the child.
    words = recording.faults[0].message
    assert "model.joblib was stopped while it was loaded" in words or "No such file" in words
    assert recording.faults[0].line == 2
    assert victim.read_text() == "secret"
    assert "secret" not in repr(recording)


def test_a_model_of_more_than_16_mb_is_refused_by_name(tmp_path: Path) -> None:
    assignment = find_assignment(str(FOLDER))
    (tmp_path / "responder.py").write_text("def responder(text): return text\n")
    (tmp_path / "model.joblib").write_bytes(bytes((16 << 20) + 1))
    with pytest.raises(UsageError, match=r"model\.joblib is too large, expected at most 16 MB a file"):
        read_submission(tmp_path, required_parts=assignment.parts)


def test_large_models_that_may_be_submitted_can_be_used(runner: TrialRunner) -> None:
    files = {f"{name}.joblib": bytes(11 << 20) for name in ("first", "second")}
    text = 'size = len(open("second.joblib", "rb").read())\ndef responder(text): return str(size)\n'
    recording = run_program(runner, ASK_ONCE, responder=text, files=files, preamble="none")
    assert recording.verdict is Verdict.FINISHED, recording.faults
    assert recording.messages[-1].text == str(11 << 20)


@pytest.fixture
def weights(monkeypatch: pytest.MonkeyPatch) -> Iterator[ModuleType]:
    """Yield the kit's module as responders import it, removed afterwards."""
    monkeypatch.syspath_prepend(str(KIT))
    yield importlib.import_module("nn_tools.weights")
    for name in [name for name in sys.modules if name.split(".")[0] == "nn_tools"]:
        del sys.modules[name]


def _weights(**changed: Any) -> bytes:
    arrays: dict[str, Any] = {
        "coefs_0": np.eye(4, 3),
        "intercepts_0": np.zeros(3),
        "coefs_1": np.eye(3, 2),
        "intercepts_1": np.zeros(2),
        "activation": "relu",
        "classes": ["left", "right"],
    }
    arrays = {key: value for key, value in (arrays | changed).items() if value is not None}
    file = io.BytesIO()
    np.savez(file, **arrays)
    return file.getvalue()


def _empty_zip() -> bytes:
    file = io.BytesIO()
    zipfile.ZipFile(file, "w").close()
    return file.getvalue()


@pytest.mark.parametrize(
    ("data", "sentence"),
    [
        (b"no zip at all", "model.npz is no file of plain weights; expected arrays written by numpy.savez"),
        (_weights()[:200], "model.npz is no file of plain weights"),
        (_empty_zip(), "model.npz has no array called coefs_0; expected coefs_0, intercepts_0, coefs_1"),
        (_weights(classes=None), "model.npz has no array called classes"),
        (_weights(intercepts_1=None), "model.npz has no array called intercepts_1"),
        (_weights(activation="swish"), "model.npz has the activation 'swish'; expected one of relu, tanh, logistic"),
        (_weights(classes=["one"]), "model.npz has 1 classes and 2 outputs; expected as many"),
        (_weights(coefs_1=np.eye(5, 2)), "coefs_1 in model.npz takes 5 numbers, but the layer before gives 3"),
        (_weights(intercepts_0=np.zeros(9)), "have the shapes (4, 3) and (9,); expected (inputs, outputs)"),
        (_weights(coefs_0=np.array([["a"]])), "coefs_0 in model.npz does not hold numbers"),
        (_weights(coefs_0=np.array([object()])), "model.npz is no file of plain weights"),
    ],
)
def test_a_bad_file_of_weights_is_refused_with_a_sentence(
    tmp_path: Path, weights: ModuleType, data: bytes, sentence: str
) -> None:
    (tmp_path / "model.npz").write_bytes(data)
    with pytest.raises(ValueError, match=re.escape(sentence)):
        weights.load_weights(tmp_path / "model.npz")


@pytest.mark.parametrize("activation", ["relu", "tanh", "logistic", "identity"])
def test_plain_weights_answer_as_the_network_that_they_come_from(
    tmp_path: Path, weights: ModuleType, activation: str
) -> None:
    network = load_perceptron(load_weights("shapes"))
    network.activation = activation
    weights.save_weights(network, tmp_path / "model.npz")
    loaded = weights.load_weights(tmp_path / "model.npz")
    images = np.random.default_rng(3).random((50, 196))
    assert np.allclose(loaded.predict_proba(images), network.predict_proba(images))
    assert np.array_equal(loaded.predict(images), network.predict(images))


def test_the_responders_are_what_their_maker_makes() -> None:
    for name, files in grading_requests().items():
        assert (FOLDER / name / "responder.py").read_bytes() == files["responder.py"], name
