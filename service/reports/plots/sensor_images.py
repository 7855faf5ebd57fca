"""The images that a light sensor sent: which are shown, which were misread, and what is like them. Draws nothing.

Nearest is by the grey values of the focus that a network is shown; what is right was decided when the work was marked.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from PIL import Image as Pixels

from service.grading.grade import Prediction
from sim.recording import Image

MOST_PREDICTIONS = 12
MOST_MISREAD = 6
#: The part of the 20 x 20 image that lies wholly inside the round sensor: left, upper, right, lower.
FOCUS = (3, 3, 17, 17)


@dataclass(frozen=True, slots=True)
class Misread:
    """An image that was misread, and the nearest rightly read one of its truth and of its answer, if there is one."""

    number: int  # of the image, from 1
    prediction: Prediction
    like_truth: Prediction | None
    like_answer: Prediction | None


def chosen_predictions(predictions: Sequence[Prediction]) -> tuple[int, ...]:
    """Indices of the images to show, ascending; if there are too many, all wrong ones come first."""
    order = sorted(range(len(predictions)), key=lambda index: (is_right(predictions[index]), index))
    return tuple(sorted(order[:MOST_PREDICTIONS]))


def is_right(prediction: Prediction) -> bool:
    """Whether the answer was the truth."""
    return prediction.answer is not None and prediction.answer == prediction.truth


def sensor_image(image: Image) -> Pixels.Image:
    """What the left sensor sent, as an RGB image of ``image.side`` squared."""
    return Pixels.frombytes("RGBA", (image.side, image.side), image.left).convert("RGB")


def focus_image(image: Image) -> Pixels.Image:
    """The greyscale crop that a network is shown; sensors of another size than 20 are shown whole."""
    whole = sensor_image(image).convert("L")
    return whole.crop(FOCUS) if image.side == 20 else whole


def misread(predictions: Sequence[Prediction]) -> tuple[Misread, ...]:
    """Every image that was answered, and wrongly, in the order in which they were sent.

    The nearest ones are looked for only for the images that are drawn.
    """
    wrong = [
        (number, prediction)
        for number, prediction in enumerate(predictions, start=1)
        if prediction.answer is not None and not is_right(prediction)
    ]
    greys = [(prediction, _greys(prediction)) for prediction in predictions if is_right(prediction)] if wrong else []
    drawn = (
        Misread(
            number,
            prediction,
            _nearest(prediction, prediction.truth, greys),
            _nearest(prediction, prediction.answer, greys),
        )
        for number, prediction in wrong[:MOST_MISREAD]
    )
    return (*drawn, *(Misread(number, prediction, None, None) for number, prediction in wrong[MOST_MISREAD:]))


def _greys(prediction: Prediction) -> NDArray[np.float64]:
    return np.asarray(focus_image(prediction.image), dtype=np.float64)


def _nearest(
    prediction: Prediction, label: str | None, greys: Sequence[tuple[Prediction, NDArray[np.float64]]]
) -> Prediction | None:
    own = _greys(prediction)
    alike = [(prediction, grey) for prediction, grey in greys if prediction.truth == label and grey.shape == own.shape]
    return min(alike, key=lambda pair: float(((pair[1] - own) ** 2).sum()), default=(None, own))[0]
