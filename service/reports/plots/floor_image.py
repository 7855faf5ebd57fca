"""Drawing of the part of a floor that a plot shows, lightened, and of the whole floor as a small picture."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from service.reports.plots.panel import Panel
from service.reports.plots.style import lighten
from sim.floors.canvas import Pixels

FLOOR_WIDTH, FLOOR_HEIGHT = 2362.0, 1143.0
_MAX_COLUMNS = 1300  # more are halved, because a plot has about 650 pixels for them
_LOCATOR_STEP = 6  # mm between the pixels of the small floor
_LIGHTER = [lighten(value) for value in range(256)]


@dataclass(frozen=True, slots=True)
class Viewport:
    """The part of the world that is drawn, mm."""

    left: float
    bottom: float
    right: float
    top: float

    @property
    def width(self) -> float:
        """The width, mm."""
        return self.right - self.left

    @property
    def height(self) -> float:
        """The height, mm."""
        return self.top - self.bottom


def draw_floor_part(panel: Panel, floor: Pixels | None, view: Viewport) -> None:
    """Draw the part of the floor in ``view``; white if there is no floor."""
    if floor is None:
        panel.add_rectangle((0, 0), FLOOR_WIDTH, FLOOR_HEIGHT, fill="white")
        return
    rows, columns = floor.shape[:2]
    left, right = max(0, math.floor(view.left)), min(columns, math.ceil(view.right))
    top, bottom = max(0, math.floor(rows - view.top)), min(rows, math.ceil(rows - view.bottom))
    if left >= right or top >= bottom:
        return
    part = Image.fromarray(floor[top:bottom, left:right])
    if right - left > _MAX_COLUMNS:
        part = part.reduce(2)
    panel.add_picture(_lighten_pixels(part), left, rows - bottom, right, rows - top)


def draw_small_floor(panel: Panel, floor: Pixels) -> None:
    """Draw the whole floor with a pixel for every 6 mm."""
    small_floor = _lighten_pixels(Image.fromarray(floor[::_LOCATOR_STEP, ::_LOCATOR_STEP].copy()))
    panel.add_picture(small_floor, 0, 0, FLOOR_WIDTH, FLOOR_HEIGHT)


def _lighten_pixels(image: Image.Image) -> NDArray[np.uint8]:
    return np.asarray(image.point(_LIGHTER * 3))
