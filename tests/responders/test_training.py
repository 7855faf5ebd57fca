"""Submissions that collect data or train a model on it, with real runs; mistakes get a verdict and a sentence."""

from __future__ import annotations

from collections import Counter
from dataclasses import replace
from itertools import pairwise
from typing import Any

import pytest

from responders.source_file import SourceFile
from service.grading.grade import Grade
from service.grading.grader import grade
from service.grading.judging.collecting import collect_pairs
from service.grading.judging.judge import judge
from service.grading.trial_runner import TrialRunner
from service.reports.verdict_sentences import describe_accuracy
from service.reports.view import build_student_view
from sim.errors import UsageError
from sim.recording import Recording, Verdict
from submissions.assignment.definition import Assignment
from submissions.assignment.examples import locate_examples
from submissions.assignment.reader import find_assignment
from submissions.bundle import read_submission
from submissions.submission import Cell, Notebook, Submission

NEAREST = """
from sklearn.neighbors import KNeighborsClassifier
def train(images, labels):
    print(images.shape, images.dtype, images.min(), images.max(), sorted(set(labels))[0])
    return KNeighborsClassifier(1).fit(images, labels)
"""
ROWS = """
class Model:
    def predict(self, rows):
        {}
def train(images, labels):
    return Model()
"""


@pytest.fixture(scope="module")
def training() -> Assignment:
    """Return the catalogue's assignment with one trial per scenario and a small budget."""
    assignment = find_assignment("train-a-recogniser")
    scenarios = tuple(
        replace(scenario, trials=1, light_noise=(0.0,))
        for scenario in assignment.scenarios
        if scenario.id in ("collected", "unseen")
    )
    criteria = tuple(criterion for criterion in assignment.criteria if criterion.id == "unseen")
    limits = replace(assignment.limits, responder_cpu=1.0, responder_memory_mb=512)
    return replace(assignment, scenarios=scenarios, criteria=criteria, limits=limits)


def trained(runner: TrialRunner, assignment: Assignment, text: str) -> Grade:
    return grade(Submission("s", None, SourceFile("responder.py", text)), assignment, runner=runner)


def test_training_without_images_says_that_there_are_none(runner: TrialRunner, training: Assignment) -> None:
    own = replace(training, parts=replace(training.parts, program="student"))
    submission = Submission("s", SourceFile("robot.py", "print('nothing')"), SourceFile("responder.py", NEAREST))
    result = grade(submission, own, runner=runner)
    fault = result.trials[-1].recording.faults[0]
    assert fault.message == "the robot collected no images, so there is nothing to train on"
    assert (fault.who, fault.verdict, result.marks) == ("program", Verdict.PROGRAM_ERROR, 0)
    assert "image_data" in fault.hint


@pytest.mark.long
def test_the_accuracy_of_a_grade_is_that_of_the_marked_images(runner: TrialRunner) -> None:
    assignment = find_assignment("train-a-recogniser")
    kept = tuple(replace(each, trials=1) for each in assignment.scenarios if each.id != "unseen-with-noise")
    criteria = tuple(each for each in assignment.criteria if each.id in ("practice", "unseen"))
    result = trained(runner, replace(assignment, scenarios=kept, criteria=criteria), NEAREST)
    assert result.recognition is not None
    assert (result.recognition.id, result.accuracy) == ("unseen", result.criteria[1].accuracy)
    view = build_student_view(result).grade
    assert view.recognition is not None
    assert (view.recognition.id, "for practice (not marked)" in describe_accuracy(view)) == ("practice", True)
    assert "practice" not in describe_accuracy(result)


@pytest.mark.long
def test_a_model_is_trained_on_some_trials_and_marked_on_the_others(runner: TrialRunner, training: Assignment) -> None:
    result = trained(runner, training, NEAREST)
    learnt, unseen = result.trials
    assert result.verdict is Verdict.FINISHED
    assert learnt.recording.messages == ()
    assert learnt.recording.sheet != unseen.recording.sheet
    assert "196) float64 0.0 1.0 diamond" in unseen.recording.responder_output
    accuracy = result.accuracy
    assert accuracy is not None
    assert accuracy.value > 0.5
    assert accuracy.counts is not None
    assert accuracy.counts.sent == accuracy.counts.answered == 170
    again = trained(runner, training, NEAREST)
    assert [trial.recording.sha256 for trial in again.trials] == [trial.recording.sha256 for trial in result.trials]
    other = trained(runner, training, NEAREST.replace("fit(images, labels)", "fit(images, labels[::-1])"))
    assert other.trials[0].recording.sha256 == learnt.recording.sha256
    assert other.trials[1].recording.sha256 != unseen.recording.sha256


@pytest.mark.long
@pytest.mark.parametrize(
    ("text", "verdict", "sentence"),
    [
        ("def train(images, labels):\n    return 1 / 0", Verdict.RESPONDER_ERROR, "division by zero (line 2)"),
        ("def train(images, labels):\n    return 3", Verdict.RESPONDER_ERROR, "returned int, which has no predict"),
        ("def fit(images, labels): pass", Verdict.RESPONDER_ERROR, "there is no function called train"),
        ("def train(images, labels)", Verdict.RESPONDER_ERROR, "SyntaxError: expected ':' (line 1)"),
        ("def train(images, labels):\n    while True: pass", Verdict.CPU_LIMIT, "more than 1 seconds of CPU time"),
        (
            "def train(images, labels):\n    return bytearray(2 << 30)",
            Verdict.MEMORY_LIMIT,
            "asked for more memory than it may have (line 2)",
        ),
        (ROWS.format("return ['square']"), Verdict.RESPONDER_ERROR, "predict gave 1 answers for"),
        (ROWS.format("raise KeyError('no')"), Verdict.RESPONDER_ERROR, "KeyError: 'no' (line 4)"),
        (ROWS.format("return [0.5] * len(rows)"), Verdict.FINISHED, 'the answer names no label: "0.5"'),
        (
            ROWS.format("import json; json.dumps = lambda *a, **k: '[1'; return [rows] * len(rows)"),
            Verdict.RESPONDER_ERROR,
            "returned a value that cannot be read",
        ),
    ],
)  # fmt: skip
def test_what_goes_wrong_in_training_is_told(
    runner: TrialRunner, training: Assignment, text: str, verdict: Verdict, sentence: str
) -> None:
    result = trained(runner, training, text)
    messages = " ".join(each.message for each in result.criteria)
    assert (result.verdict, result.marks) == (verdict, 0), messages
    assert sentence in messages
    assert result.trials[0].verdict is Verdict.FINISHED


def test_the_labels_of_unseen_images_are_nowhere_in_the_child(runner: TrialRunner, training: Assignment) -> None:
    """Searches everything a submission can reach: its folder, and its process's memory while it labels images."""
    text = """
import gc, os, numpy
def train(images, labels):
    return Model(len(labels))
class Model:
    def __init__(self, count):
        self.count = count
    def predict(self, rows):
        arrays = [a for a in gc.get_objects() if isinstance(a, (list, tuple)) and 3 < len(a) <= 400]
        named = {len(a) for a in arrays if all(isinstance(x, str) and "triangle" in x for x in a)}
        print(sorted(os.listdir(".")), [numpy.load("train.npz")["labels"].size == self.count], sorted(named))
        return ["square"] * len(rows)
"""
    output = trained(runner, training, text).trials[1].recording.responder_output
    assert output.splitlines()[0] == "['train.npz'] [True] []"


def test_unseen_images_do_not_come_in_the_order_of_the_track(runner: TrialRunner, training: Assignment) -> None:
    """Otherwise a model could label a whole stretch by its clearest image."""
    result = trained(runner, training, ROWS.format("return [str(place) for place in range(len(rows))]"))
    messages = result.trials[1].recording.messages
    places = [int(message.text) for message in messages if message.sender == "responder"][:100]
    neighbours = sum(abs(one - other) == 1 for one, other in pairwise(places))
    assert neighbours < 10


def test_a_notebook_is_no_function_that_trains(runner: TrialRunner, training: Assignment) -> None:
    notebook = Notebook("work.ipynb", (Cell(1, "def train(images, labels): pass"),))
    with pytest.raises(UsageError, match=r"work.ipynb: is a notebook, expected responder.py with a function train"):
        grade(Submission("s", notebook=notebook), training, runner=runner)


def collected(runner: TrialRunner, name: str) -> Recording:
    assignment = find_assignment("collect-shapes")
    submission = read_submission(locate_examples("collect-shapes") / name, required_parts=assignment.parts)
    return grade(submission, assignment, runner=runner).trials[0].recording


@pytest.mark.long
def test_pairs_of_the_log_know_what_they_show(runner: TrialRunner) -> None:
    recording = collected(runner, "reference")
    pairs = collect_pairs(recording, "log")
    assert len(pairs) * 2 == len(recording.image_log)
    assert collect_pairs(recording, "sent") == []
    usable = Counter(pair.label for pair in pairs if pair.label is not None)
    assert len(usable) == 6
    # A patch that can be decoded is correct, or the sensor is beside the shape.
    assert all(pair.truth in (None, pair.decoded) for pair in pairs if pair.decoded is not None)
    assert sum(usable.values()) < len(pairs)


@pytest.fixture(scope="module")
def collected_grade(runner: TrialRunner) -> Grade:
    assignment = find_assignment("collect-shapes")
    submission = read_submission(locate_examples("collect-shapes") / "reference", required_parts=assignment.parts)
    return grade(submission, assignment, runner=runner)


@pytest.mark.long
@pytest.mark.parametrize(
    ("changes", "marks"),
    [({}, 4), ({"each": 4}, 4), ({"each": 50}, 0), ({"classes": ("square",)}, 4), ({"most_duplicates": 0.0}, 0)],
)
def test_what_is_asked_of_training_data(collected_grade: Grade, changes: dict[str, Any], marks: int) -> None:
    assignment = find_assignment("collect-shapes")
    criterion = assignment.criteria[1].model_copy(update={"each": 1, "marks": 4, "over": "share", **changes})
    (result,) = judge(replace(assignment, criteria=(criterion,)), collected_grade.trials)
    assert result.marks == marks
