"""The plots and tables of a classifier's evaluation show the measured values and are reproducible."""

from __future__ import annotations

import io
import itertools
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from command import robomark
from models import load_card
from models.cards import AccuracyResults, Tally
from models.evaluation import ClassifiedImage, Evaluation
from models.families import shapes
from models.images import Photographer, Shift
from service.reports.plots.curve import AccuracyPanel, Curve, draw_curves
from service.reports.plots.drawing import Drawing, Marks, Picture, Words
from service.reports.plots.evaluation import (
    draw_evaluation_confusion,
    draw_evaluation_misread,
    draw_robustness,
    render_evaluation_plots,
)
from service.reports.plots.plot import DPI
from service.reports.plots.style import WIDTH

pytestmark = pytest.mark.fast


@pytest.fixture(scope="module")
def evaluation() -> Evaluation:
    """Return an evaluation with each shape seen three times; two squares and a diamond are misclassified."""
    read = [[0, 5, 5], [1] * 3, [2] * 3, [3] * 3, [4] * 3, [5, 5, 1]]
    with Photographer() as photographer:
        seen = [
            ClassifiedImage(place, 16, photographer.take_image(place, Shift(noise=16), draw), read[place.label][draw])
            for place, draw in itertools.product(shapes.list_shape_poses(), range(3))
        ]
    confusion = np.zeros((6, 6), int)
    for each in seen:
        confusion[each.place.label, each.answer] += 1
    about = load_card("shapes")
    table = tuple(tuple(int(count) for count in row) for row in confusion)
    return Evaluation(about, AccuracyResults(Tally(15, 18), table, about.measured.curves), tuple(seen))


def texts(drawing: Drawing) -> list[str]:
    """Return the texts of a drawing, each on one line."""
    return [" ".join(text.split()) for text in drawing.texts]


def test_the_confusion_has_all_counts_and_the_interval(evaluation: Evaluation) -> None:
    drawing = draw_evaluation_confusion(evaluation)
    low, high = Tally(15, 18).interval
    assert f"accuracy 0.833, 95 % interval {low:.3f} to {high:.3f}, n = 18 images" in texts(drawing)
    written = [item.text for item in drawing.items if isinstance(item, Words) and item.bold]
    assert sorted(int(text) for text in written if text.isdecimal()) == [1, 1, 2, 2, 3, 3, 3, 3]
    assert (written.count("✓"), written.count("✗")) == (6, 2)


def test_misread_images_stand_beside_right_ones_each_kind_first(evaluation: Evaluation) -> None:
    drawing = draw_evaluation_misread(evaluation)
    labels = texts(drawing)
    assert "all 3 misread, of n = 18 images; 14 × 14 grey pixels" in labels
    assert [text for text in labels if text.startswith("✗")] == [
        "✗ read as diamond",
        "✗ read as right facing triangle",
        "✗ read as diamond",
    ]
    images = [item.pixels[:, :, 0] for item in drawing.items if isinstance(item, Picture)]
    assert len(images) == 9
    right = {each.grey.tobytes(): each.place.label for each in evaluation.answered if each.right}
    assert [right.get(pixels.tobytes()) for pixels in images] == [None, 0, 5, None, 5, 1, None, 0, 5]


def test_robustness_has_a_panel_for_each_condition_with_unit_and_n(evaluation: Evaluation) -> None:
    drawing = draw_robustness(evaluation)
    actual = texts(drawing)
    labels = (
        "light noise, grey levels either way",
        "offset in x, mm",
        "offset in y, mm",
        "heading, degrees",
        "turned image, degrees",
        "size of the image, %",
        "covered square, mm each way",
    )
    assert [text for text in actual if text in labels] == list(labels)
    assert actual.count("n = 6 to 120 images per point") == 4
    values = evaluation.measured.curves[1].values
    marks = [item.points[:, 0] for item in drawing.items if isinstance(item, Marks)][1]
    # The marks are on one scale: inches grow with the values.
    assert np.allclose(np.diff(marks) / np.diff(values), (marks[-1] - marks[0]) / (values[-1] - values[0]))


def test_all_plots_are_as_wide_as_a_phone_shows_and_come_out_the_same(evaluation: Evaluation) -> None:
    first, second = render_evaluation_plots(evaluation), render_evaluation_plots(evaluation)
    assert first == second
    assert set(first) == {"shapes-confusion.png", "shapes-misread.png", "shapes-robustness.png"}
    for data in first.values():
        with Image.open(io.BytesIO(data)) as pixels:
            assert pixels.width == round(WIDTH * DPI)


def test_a_level_that_is_asked_for_and_a_single_point_are_drawn() -> None:
    curve = Curve("x", (3.0,), (0.5,), (0.2,), (0.8,), (12,))
    drawing = draw_curves([AccuracyPanel("delay", "seconds", (curve,), level=0.8)], "A curve")
    assert "required: 0.8" in texts(drawing)
    assert "n = 12 images per point" in texts(drawing)


@pytest.mark.long
def test_the_list_has_every_model_with_its_interval() -> None:
    done = robomark("models", "list")
    assert done.returncode == 0
    accuracy = load_card("digits").measured.accuracy
    low, high = accuracy.interval
    (line,) = [line for line in done.stdout.splitlines() if line.startswith("digits ")]
    for part in (f"{accuracy.share:.3f}", f"{low:.3f} to {high:.3f}", str(accuracy.n)):
        assert part in line


def test_classifiers_are_compared_on_the_same_images(tmp_path: Path) -> None:
    done = robomark("models", "compare", "digits", "digits-cnn", "--output", tmp_path)
    assert done.returncode == 0, done.stderr
    (line,) = [line for line in done.stdout.splitlines() if line.strip().startswith("accuracy")]
    for name in ("digits", "digits-cnn"):
        accuracy = load_card(name).measured.accuracy
        low, high = accuracy.interval
        assert f"{accuracy.share:.3f} ({low:.3f} to {high:.3f})" in line
    assert line.split()[-1] == str(accuracy.n)
    assert (tmp_path / "digits-and-digits-cnn.png").exists()


def test_classifiers_of_different_things_are_not_compared() -> None:
    done = robomark("models", "compare", "digits", "shapes")
    assert done.returncode == 2
    assert "digits, shapes cannot be compared; expected two or more models of the same classes" in done.stderr
