"""Reading of the grey patch beside a pattern in the right sensor's image, as in the course's notebooks.

The input is an image, the output a label. The robot's position does not matter.
"""

from __future__ import annotations

from collections.abc import Mapping
from itertools import pairwise
from types import MappingProxyType

import numpy as np
from numpy.typing import NDArray
from PIL import Image as Pixels

from sim.floors import SHAPES
from sim.recording import Image

#: A median that differs more from a label's grey, or is nearer to another's, matches no label.
_TOLERANCE = 12.0
#: The fraction of the focus that must have the patch's grey. An image with an edge of a patch is not usable.
_UNIFORM_SHARE = 0.98
_SLACK = 3.0

_SHAPES: Mapping[int, str] = MappingProxyType({int(code * 255 / 6): name for code, name in enumerate(SHAPES)})
_DIGITS: Mapping[int, str] = MappingProxyType({25 * digit: str(digit) for digit in range(10)})
#: The labels of the greys, by the name that an assignment uses for its own floor image.
CODES: Mapping[str, Mapping[int, str]] = MappingProxyType({"shapes": _SHAPES, "digits": _DIGITS})
#: The label of each grey, by floor: decode_shape_label in 08.4, get_training_label_from_sensor in 08.2.
GREYS: Mapping[str, Mapping[int, str]] = MappingProxyType(
    {
        "Simple_Shapes": _SHAPES,
        "Shuffled_Shapes": _SHAPES,
        "MNIST_Digits": _DIGITS,
        "MNIST_Digits_Black": _DIGITS,
    }
)


def decode_label(image: Image, greys: Mapping[int, str], light_noise: float = 0.0) -> str | None:
    """Return the label whose patch fills the right image's focus; None if there is none.

    ``light_noise`` is the amplitude of pixel noise, in grey levels.
    """
    if not greys or len(image.right) != 4 * image.side**2:
        return None
    pixels = crop_focus(image.right, image.side).astype(np.float64)
    median = float(np.median(pixels))
    grey = min(greys, key=lambda known: abs(known - median))
    min_gap = min((after - before for before, after in pairwise(sorted(greys))), default=256)
    if abs(grey - median) > min(_TOLERANCE, min_gap / 2):
        return None
    is_alike = np.abs(pixels - median) <= 2 * light_noise + _SLACK
    return greys[grey] if is_alike.mean() >= _UNIFORM_SHARE else None


def crop_focus(rgba: bytes, side: int) -> NDArray[np.uint8]:
    """Return the red values of the square inside the round sensor: 14 x 14 of 20 x 20.

    The crop (3, 3, 17, 17) is the course's ``sensor_image_focus``. Other sizes are cropped in proportion.
    """
    edge = round(side * 3 / 20)
    return _reshape_pixels(rgba, side)[edge : side - edge, edge : side - edge, 0]


def convert_to_grey(image: Image, *, focus: bool) -> NDArray[np.uint8]:
    """Return the left image in greys (Pillow's ``convert("L")``): its 14 x 14 focus, or all 20 x 20 pixels."""
    edge = round(image.side * 3 / 20) if focus else 0
    rgb = np.ascontiguousarray(_reshape_pixels(image.left, image.side)[:, :, :3])
    grey = np.asarray(Pixels.fromarray(rgb).convert("L"))
    return np.ascontiguousarray(grey[edge : image.side - edge, edge : image.side - edge])


def _reshape_pixels(rgba: bytes, side: int) -> NDArray[np.uint8]:
    return np.frombuffer(rgba, dtype=np.uint8).reshape(side, side, 4)
