"""Selection of light sensor images: those to show, the misread ones, and their nearest neighbours. Draws nothing.

Distance is by the grey values of the focus that a network gets. Answers were judged during grading.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from PIL import Image as Pixels

from service.grading.grade import Prediction
from sim.recording import Image

MAX_PREDICTIONS = 12
MAX_MISREAD = 6
#: The part of the 20 x 20 image inside the round sensor: left, upper, right, lower.
FOCUS = (3, 3, 17, 17)


@dataclass(frozen=True, slots=True)
class MisreadImage:
    """A misread image, and the nearest correctly read ones of its truth and of its answer, if they exist."""

    number: int  # of the image, from 1
    prediction: Prediction
    like_truth: Prediction | None
    like_answer: Prediction | None


def select_predictions(predictions: Sequence[Prediction]) -> tuple[int, ...]:
    """Return the indices of the images to show, ascending. If there are too many, wrong ones have priority."""
    order = sorted(range(len(predictions)), key=lambda index: (is_right(predictions[index]), index))
    return tuple(sorted(order[:MAX_PREDICTIONS]))


def is_right(prediction: Prediction) -> bool:
    """Return whether the answer equals the truth."""
    return prediction.answer is not None and prediction.answer == prediction.truth


def to_rgb_image(image: Image) -> Pixels.Image:
    """Return the left sensor's image as RGB, ``image.side`` squared."""
    return Pixels.frombytes("RGBA", (image.side, image.side), image.left).convert("RGB")


def crop_focus(image: Image) -> Pixels.Image:
    """Return the greyscale crop that a network gets. Sensors of a size other than 20 are shown whole."""
    grey_image = to_rgb_image(image).convert("L")
    return grey_image.crop(FOCUS) if image.side == 20 else grey_image


def find_misread(predictions: Sequence[Prediction]) -> tuple[MisreadImage, ...]:
    """Return every wrongly answered image, in the order sent.

    Neighbours are searched only for the images that are drawn.
    """
    wrong_predictions = [
        (number, prediction)
        for number, prediction in enumerate(predictions, start=1)
        if prediction.answer is not None and not is_right(prediction)
    ]
    greys = (
        [(prediction, _to_greys(prediction)) for prediction in predictions if is_right(prediction)]
        if wrong_predictions
        else []
    )
    compared_images = (
        MisreadImage(
            number,
            prediction,
            _find_nearest(prediction, prediction.truth, greys),
            _find_nearest(prediction, prediction.answer, greys),
        )
        for number, prediction in wrong_predictions[:MAX_MISREAD]
    )
    return (
        *compared_images,
        *(MisreadImage(number, prediction, None, None) for number, prediction in wrong_predictions[MAX_MISREAD:]),
    )


def _to_greys(prediction: Prediction) -> NDArray[np.float64]:
    return np.asarray(crop_focus(prediction.image), dtype=np.float64)


def _find_nearest(
    prediction: Prediction, label: str | None, greys: Sequence[tuple[Prediction, NDArray[np.float64]]]
) -> Prediction | None:
    target_pixels = _to_greys(prediction)
    candidates = [
        (prediction, grey)
        for prediction, grey in greys
        if prediction.truth == label and grey.shape == target_pixels.shape
    ]
    return min(
        candidates, key=lambda pair: float(((pair[1] - target_pixels) ** 2).sum()), default=(None, target_pixels)
    )[0]
