"""Plots of recognition: confusion with precision and recall, misclassified images, curves, and the track."""

from __future__ import annotations

import io
from dataclasses import replace

import numpy as np
import pytest
from PIL import Image as Pixels

import report_builders as build
from service.grading.grade import Accuracy, CriterionResult, Grade, Prediction, TrialResult
from service.reports.html import render_report_page
from service.reports.plots.confusion import draw_confusion
from service.reports.plots.grade_plots import draw_all_plots, list_plots
from service.reports.plots.misread_images import draw_misread
from service.reports.plots.sensor_images import find_misread
from service.reports.plots.track import compute_accuracy_curve, draw_track
from service.reports.plots.track_images import collect_track_images, find_tracks, find_worst_track
from service.reports.view import build_student_view
from sim.floors import build_floor
from sim.recording import Image, Pose


def _moving() -> Grade:
    """Return two line-follower trials with an image every half second; half of the second one's answers are correct."""
    grade = build.line_follower_grade()
    left = build.shape_grade().trials[0].recording.images[0].left
    trials: list[TrialResult] = []
    predictions = []
    for index, trial in enumerate(grade.trials):
        ticks = trial.recording.ticks
        images = tuple(
            Image(row / 30, row, Pose(float(ticks.x[row]), float(ticks.y[row]), 0.0), left, left, 0, "square")
            for row in range(10, 290, 15)
        )
        trials.append(replace(trial, recording=replace(trial.recording, images=images)))
        answers = ("square", "square") if index == 0 else ("square", None)
        predictions += [
            Prediction(image, "square", answers[n % 2], trial.scenario, index) for n, image in enumerate(images)
        ]
    result = replace(grade.criteria[0], predictions=tuple(predictions))
    return replace(grade, trials=tuple(trials), criteria=(result, *grade.criteria[1:]))


def test_recognition_has_its_plots() -> None:
    kinds = [plot.kind for plot in list_plots(build.swept_grade()) if not plot.scenario]
    assert kinds == ["confusion", "curves", "misread", "predictions"]
    assert [plot.kind for plot in list_plots(_moving()) if not plot.scenario] == ["track", "predictions"]
    for data in draw_all_plots(build.swept_grade()).values():
        assert 300 < Pixels.open(io.BytesIO(data)).height < 2600


def test_confusion_tells_precision_and_recall_and_what_n_counts() -> None:
    accuracy = Accuracy(0.5, 0.2, 0.8, 8, ("a", "b"), (("a", "a", 3), ("a", "b", 1), ("b", "b", 1), ("b", None, 3)))
    result = CriterionResult("c", "C", build.shape_grade().marks, build.shape_grade().marks, "")
    confusion = draw_confusion(result, accuracy, "t").texts
    assert {"precision", "recall", ".75", ".25", ".50", "1"} <= set(confusion)  # b: recall 1 of 4, precision 1 of 2
    assert any("n = 8 images" in text for text in confusion)


def test_a_misread_image_stands_beside_the_nearest_right_ones() -> None:
    grade = build.shape_grade(wrong=4)
    (misread,) = find_misread(grade.criteria[0].predictions)
    assert (misread.number, misread.prediction.truth, misread.prediction.answer) == (
        5,
        "upwards facing triangle",
        "diamond",
    )
    assert misread.like_truth is None
    assert misread.like_answer is not None
    assert misread.like_answer.truth == "diamond"
    actual = draw_misread([misread], 6, "t").texts
    assert {"misread", "correct,\nsame truth", "correct,\nsame answer", "none", "5. ✗ wrong"} <= set(actual)
    assert any("1 misread of n = 6 images" in text for text in actual)
    # Of two correct images of a class, the nearer one is shown.
    far = replace(misread.like_answer, image=replace(misread.like_answer.image, left=b"\x80" * 1600))
    (again,) = find_misread((far, *grade.criteria[0].predictions))
    assert again.like_answer is misread.like_answer


def test_a_track_shows_every_image_and_the_share_along_the_way() -> None:
    grade = _moving()
    predictions = grade.criteria[0].predictions
    assert find_tracks(predictions, grade.trials) == (0, 1)
    assert find_worst_track(predictions, grade.trials) == 1
    images = collect_track_images(predictions, grade.trials, 1)
    assert [item.right for item in images[:3]] == [True, False, True]
    assert not images[1].answered
    way = np.array([item.distance for item in images])
    assert (np.diff(way) > 0).all()
    curve = compute_accuracy_curve([*collect_track_images(predictions, grade.trials, 0), *images])
    assert sum(curve.n) == len(predictions)
    assert all(low <= share <= high for low, share, high in zip(curve.low, curve.share, curve.high, strict=True))
    track = draw_track(predictions, grade.trials, "t", build_floor("Simple_Shapes").pixels).texts
    assert {"x, mm", "y, mm", "distance driven, mm", "accuracy"} <= set(track)
    assert any(f"of n = {len(predictions)} images correct, 2 trials" in text for text in track)


def test_standing_still_is_no_track() -> None:
    grade = build.shape_grade()
    assert find_tracks(grade.criteria[0].predictions, grade.trials) == ()


@pytest.mark.parametrize("make", [build.swept_grade, build.hostile_grade])
def test_the_page_has_the_figures(make: object) -> None:
    grade = make()  # type: ignore[operator]
    page = render_report_page(build_student_view(grade), {})
    assert "Results by class" in page
    if make is build.swept_grade:
        assert "Images sent: 7 = 5 answered + 1 late + 0 malformed + 1 unanswered; duplicate answers: 2." in page
        assert "Mean confidence 0.90 when correct (n = 5)." in page
