"""Floors as data URIs for pages: small, and drawn once for many pages."""

from __future__ import annotations

import base64
import io
from functools import lru_cache
from typing import Any

import numpy as np
from PIL import Image

from sim.floors import build_floor, build_floor_from_image
from sim.floors.canvas import Pixels

_MAX_BYTES = 120_000


# All floors of the course. Drawing and encoding one takes up to a second.
@lru_cache(maxsize=32)
def encode_built_in_floor(name: str, labels: bool, sheet: int) -> str:
    """Return the floor with this name; without ``labels``, without the patches that encode the answers."""
    return encode_floor(build_floor(name, labels=labels, seed=sheet).pixels)


@lru_cache(maxsize=4)
def encode_own_floor(name: str, image: bytes) -> str:
    """Return an instructor's floor from the bytes of its image file. Raises UsageError if they are not an image."""
    return encode_floor(build_floor_from_image(name, image).pixels)


def encode_floor(pixels: Pixels) -> str:
    """Return the image as a data URI: lossless if that is small, as for printed floors, otherwise lossy."""
    image = Image.fromarray(np.ascontiguousarray(pixels[:, :, :3]))
    data = _encode_webp(image, lossless=True, method=2)
    if len(data) > _MAX_BYTES:
        data = _encode_webp(image.resize((image.width // 2, image.height // 2)), quality=70)
    return f"data:image/webp;base64,{base64.b64encode(data).decode('ascii')}"


def _encode_webp(image: Image.Image, **options: Any) -> bytes:
    buffer = io.BytesIO()
    image.save(buffer, "WEBP", **options)
    return buffer.getvalue()
