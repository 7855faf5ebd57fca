"""A marked digit sheet: the same for all students, or a new one each trial, and shown in reports as it was."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from notebook_builder import notebook
from responders.source_file import SourceFile
from service.grading.grade import Grade
from service.grading.grader import grade
from service.grading.trial_runner import TrialRunner
from service.reports.plots.grade_plots import draw_all_plots
from service.store.grades.recordings import from_bytes, to_bytes
from sim.floors import build_floor, list_label_names
from sim.recording import SENSOR_SIDE, Image
from submissions.assignment.definition import Assignment
from submissions.assignment.problems import AssignmentProblems
from submissions.assignment.reader import read_assignment
from submissions.bundle import read_submission
from submissions.submission import Submission

ASSIGNMENT = """
id = "digits"
title = "Digits"
[world]
background = "MNIST_Digits"
labels = {labels}
sheet = {sheet}
[parts]
responder = "responder.py"
[[scenario]]
id = "two"
poses = [[400, 50, 90]]
trials = 2
seconds = 5
[[criterion]]
title = "Reads the digit"
marks = 1
check = "classification"
truth = "label"
"""
LOOK = Submission("ada", SourceFile("robot.py", 'import time\nprint("IMG_DATA")\ntime.sleep(1)\n'))


def assignment(folder: Path, sheet: str, labels: str = "false") -> Assignment:
    (folder / "assignment.toml").write_text(ASSIGNMENT.format(sheet=sheet, labels=labels))
    (folder / "responder.py").write_text('def responder(msg):\n    return "7"\n')
    return read_assignment(folder)


def graded(folder: Path, sheet: str, runner: TrialRunner, labels: str = "false") -> Grade:
    return grade(LOOK, assignment(folder, sheet, labels), runner=runner)


def extract_pixels(image: Image) -> bytes:
    """Return the 14 x 14 grey levels in the middle of the left sensor's image."""
    rgba = np.frombuffer(image.left, np.uint8).reshape(SENSOR_SIDE, SENSOR_SIDE, 4)
    return rgba[3:17, 3:17, 0].tobytes()


def on_sheet(seed: int) -> bytes:
    """Return the digit under the left sensor of a robot at (400, 50, 90) on sheet ``seed``."""
    return build_floor("MNIST_Digits", seed=seed).pixels[56 + 1000 : 70 + 1000, 73 + 300 : 87 + 300, 0].tobytes()


@pytest.mark.parametrize(("sheet", "seed"), [('"fixed"', 0), ("7", 7)])
def test_every_trial_has_the_same_sheet(tmp_path: Path, runner: TrialRunner, sheet: str, seed: int) -> None:
    images = [trial.recording.images[0] for trial in graded(tmp_path, sheet, runner).trials]
    assert {extract_pixels(image) for image in images} == {on_sheet(seed)}


def test_every_trial_has_a_sheet_of_its_own_and_the_truth_follows(tmp_path: Path, runner: TrialRunner) -> None:
    result = graded(tmp_path, '"per-seed"', runner)
    for trial in result.trials:
        image = trial.recording.images[0]
        assert extract_pixels(image) == on_sheet(trial.seed)
        ground = build_floor("MNIST_Digits", seed=trial.seed)
        assert image.truth == ground.find_label(380, 80)
    assert len({extract_pixels(trial.recording.images[0]) for trial in result.trials}) == 2
    assert result.accuracy is not None
    assert result.accuracy.labels == list_label_names("MNIST_Digits") == tuple("0123456789")


@pytest.mark.long
def test_a_report_draws_the_sheet_that_lay_there_with_its_patches_or_without(
    tmp_path: Path, runner: TrialRunner
) -> None:
    bare = graded(tmp_path, '"per-seed"', runner)
    recording = bare.trials[0].recording
    assert (recording.sheet, recording.label_patches) == (bare.trials[0].seed, False)
    assert from_bytes(to_bytes(recording)).sheet == recording.sheet
    # A robot that does not move has no drawing.
    moved = replace(recording, images=(), messages=(), ticks=replace(recording.ticks, x=recording.ticks.x + 1.0))
    images = set()
    for change in ({}, {"sheet": 0}, {"label_patches": True}):
        trial = replace(bare.trials[0], recording=replace(moved, **change))
        drawn = draw_all_plots(replace(bare, criteria=(), trials=(trial,)))
        images.add(next(drawn[name] for name in drawn if name.startswith("path")))
    assert len(images) == 3


def test_a_notebook_cannot_read_the_answers_off_the_marked_sheet_beforehand(
    tmp_path: Path, runner: TrialRunner
) -> None:
    graded_assignment = assignment(tmp_path, '"per-seed"')
    graded_assignment = replace(graded_assignment, parts=replace(graded_assignment.parts, responder="student"))
    cells = [
        "def responder(text):\n    return seen",
        '%%sim_magic_preloaded -R -b MNIST_Digits -x 400 -y 50 -a 90\nprint("image_data left")',
        "seen = roboSim.image_data().vals[0]",
        '%%sim_magic_preloaded -R\nimport time\nprint("IMG_DATA")\ntime.sleep(1)',
    ]
    result = grade(
        read_submission(notebook(tmp_path / "ada.ipynb", cells), required_parts=graded_assignment.parts),
        graded_assignment,
        runner=runner,
    )
    for trial in result.trials:
        (answer,) = (message.text for message in trial.recording.messages if message.sender == "responder")
        pixels = np.array(answer.split(","), np.uint8).reshape(SENSOR_SIDE, SENSOR_SIDE, 3)
        assert pixels[3:17, 3:17, 0].tobytes() == on_sheet(0) != extract_pixels(trial.recording.images[0])


@pytest.mark.parametrize("sheet", ["-1", "true", '"new"', "1.5", "[]"])
def test_what_is_no_sheet_is_refused(tmp_path: Path, sheet: str) -> None:
    with pytest.raises(AssignmentProblems) as refused:
        assignment(tmp_path, sheet)
    (problem,) = refused.value.problems
    assert "assignment.toml:7: sheet is not a digit sheet, expected" in problem
