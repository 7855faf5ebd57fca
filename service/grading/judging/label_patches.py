"""Reading the grey patch that stands beside a pattern in the right sensor's image, as the course's notebooks do.

An image in, a label out; where the robot was does not matter here.
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

#: A median further off a label's grey, or nearer to the grey of another, is no label's.
_TOLERANCE = 12.0
#: So much of the focus must be of the patch's grey: an edge of a patch in the image makes it no use.
_UNIFORM_SHARE = 0.98
_SLACK = 3.0

_SHAPES: Mapping[int, str] = MappingProxyType({int(code * 255 / 6): name for code, name in enumerate(SHAPES)})
_DIGITS: Mapping[int, str] = MappingProxyType({25 * digit: str(digit) for digit in range(10)})
#: What the greys of patches stand for, as an assignment names it for an image of its own.
CODES: Mapping[str, Mapping[int, str]] = MappingProxyType({"shapes": _SHAPES, "digits": _DIGITS})
#: The grey of each label's patch, by floor: decode_shape_label in 08.4, get_training_label_from_sensor in 08.2.
GREYS: Mapping[str, Mapping[int, str]] = MappingProxyType(
    {
        "Simple_Shapes": _SHAPES,
        "Shuffled_Shapes": _SHAPES,
        "MNIST_Digits": _DIGITS,
        "MNIST_Digits_Black": _DIGITS,
    }
)


def decoded(image: Image, greys: Mapping[int, str], light_noise: float = 0.0) -> str | None:
    """The label whose patch fills the right image's focus, by the label of each grey; None if none does.

    ``light_noise`` is the amplitude, in grey levels, that pixels may be off.
    """
    if not greys or len(image.right) != 4 * image.side**2:
        return None
    seen = focus(image.right, image.side).astype(np.float64)
    median = float(np.median(seen))
    grey = min(greys, key=lambda known: abs(known - median))
    between = min((after - before for before, after in pairwise(sorted(greys))), default=256)
    if abs(grey - median) > min(_TOLERANCE, between / 2):
        return None
    alike = np.abs(seen - median) <= 2 * light_noise + _SLACK
    return greys[grey] if alike.mean() >= _UNIFORM_SHARE else None


def focus(rgba: bytes, side: int) -> NDArray[np.uint8]:
    """The red values of the square that lies wholly inside the round sensor: 14 x 14 of 20 x 20.

    The crop (3, 3, 17, 17) is the course's ``sensor_image_focus``; other sizes are cropped in proportion.
    """
    edge = round(side * 3 / 20)
    return _pixels(rgba, side)[edge : side - edge, edge : side - edge, 0]


def grey_image(image: Image, *, focus: bool) -> NDArray[np.uint8]:
    """The left image as greys (Pillow's ``convert("L")``): its 14 x 14 focus, or all 20 x 20 pixels."""
    edge = round(image.side * 3 / 20) if focus else 0
    rgb = np.ascontiguousarray(_pixels(image.left, image.side)[:, :, :3])
    grey = np.asarray(Pixels.fromarray(rgb).convert("L"))
    return np.ascontiguousarray(grey[edge : image.side - edge, edge : image.side - edge])


def _pixels(rgba: bytes, side: int) -> NDArray[np.uint8]:
    return np.frombuffer(rgba, dtype=np.uint8).reshape(side, side, 4)
