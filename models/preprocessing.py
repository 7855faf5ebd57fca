"""Conversion of light sensor pixels to network inputs, shared by all packaged networks.

The steps are those of the course's predictor: crop (3, 3, 17, 17), convert to grey, divide by the maximum.
``docs/models.md`` describes other conversions in the course.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from sim.random_streams import RandomStream
from sim.recording import SENSOR_SIDE

Grey = NDArray[np.uint8]
Vector = NDArray[np.float64]

#: Width and height of the focus in pixels: the square inside the round window of diameter 20.
SIDE = 14
_FOCUS = slice(3, 3 + SIDE)
#: ITU-R 601-2 luma coefficients in 65536ths, as in Pillow's mode L.
_LUMA = np.array([19595, 38470, 7471], np.int64)


def extract_focus(rgba: bytes) -> Grey:
    """Return the grey focus of a sensor's 20 x 20 RGBA pixels, shape (14, 14), values 0 to 255."""
    pixels = np.frombuffer(rgba, np.uint8).reshape(SENSOR_SIDE, SENSOR_SIDE, 4)
    return convert_to_grey(pixels[_FOCUS, _FOCUS, :3])


def convert_to_grey(rgb: NDArray[np.integer]) -> Grey:
    """Convert RGB values 0 to 255, shape (..., 3), to grey, rounded like Pillow."""
    return np.asarray((rgb.astype(np.int64) @ _LUMA + 0x8000) >> 16, np.uint8)


def add_noise(grey: Grey, noise: int, chance: RandomStream, draw: int) -> Grey:
    """Add the light sensor's noise to each colour channel, as ``sim/light_sensors.py`` does."""
    offsets = chance.uniforms(draw, grey.size * 3).reshape(*grey.shape, 3) * (2 * noise) - noise
    return convert_to_grey(np.clip(np.floor(grey[..., None] + offsets + 0.5), 0, 255).astype(np.uint8))


def compute_features(grey: Grey, side: int = SIDE) -> Vector:
    """Return network inputs for a grey focus: values 0 to 1, shape (side * side,).

    If ``side`` differs from the size of the focus, Pillow's LANCZOS filter resizes it before the division.
    """
    if grey.shape != (side, side):
        grey = np.asarray(Image.fromarray(grey).resize((side, side), Image.Resampling.LANCZOS))
    values: Vector = grey.astype(np.float64).ravel()
    return values / max(float(values.max()), 1.0)
