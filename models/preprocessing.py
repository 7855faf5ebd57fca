"""From the pixels of a light sensor to the numbers that a network is shown: one way for every packaged network.

It is the way of the course's own predictor: cut out (3, 3, 17, 17), make it grey, divide by the brightest. What else
the course does to images here and there is in ``docs/models.md``.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from sim.chance import Stream
from sim.recording import SENSOR_SIDE

Grey = NDArray[np.uint8]
Vector = NDArray[np.float64]

#: Pixels of the focus, each way: what lies wholly inside the round window of 20.
SIDE = 14
_FOCUS = slice(3, 3 + SIDE)
#: Luma of ITU-R 601-2 in 65536ths, as Pillow's mode L has it.
_LUMA = np.array([19595, 38470, 7471], np.int64)


def focus(rgba: bytes) -> Grey:
    """The grey focus of a sensor's 20 x 20 RGBA pixels, shape (14, 14), values 0 to 255."""
    pixels = np.frombuffer(rgba, np.uint8).reshape(SENSOR_SIDE, SENSOR_SIDE, 4)
    return luma(pixels[_FOCUS, _FOCUS, :3])


def luma(rgb: NDArray[np.integer]) -> Grey:
    """Grey of RGB values 0 to 255, shape (..., 3), rounded as Pillow does."""
    return np.asarray((rgb.astype(np.int64) @ _LUMA + 0x8000) >> 16, np.uint8)


def noisy(grey: Grey, noise: int, chance: Stream, draw: int) -> Grey:
    """With the light sensor's noise in each of the three colours, as ``sim/sensors.py`` has it."""
    offsets = chance.uniforms(draw, grey.size * 3).reshape(*grey.shape, 3) * (2 * noise) - noise
    return luma(np.clip(np.floor(grey[..., None] + offsets + 0.5), 0, 255).astype(np.uint8))


def features(grey: Grey, side: int = SIDE) -> Vector:
    """What a network of ``side`` x ``side`` inputs is shown of a grey focus: 0 to 1, flat, shape (side * side,).

    For another side than the focus's own it is resized by Pillow's LANCZOS filter before it is divided.
    """
    if grey.shape != (side, side):
        grey = np.asarray(Image.fromarray(grey).resize((side, side), Image.Resampling.LANCZOS))
    values: Vector = grey.astype(np.float64).ravel()
    return values / max(float(values.max()), 1.0)
