"""Canvas for drawing floors: size, colours, and drawing with hard or smooth edges.

Coordinates are image coordinates (y down).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw

#: Size of every floor, in mm and in pixels.
WIDTH, HEIGHT = 2362, 1143

#: Factor by which smooth images are enlarged before averaging.
SCALE = 4

Colour = tuple[int, int, int]
Canvas = ImageDraw.ImageDraw
Painter = Callable[[Canvas], None]
Box = tuple[float, float, float, float]
Pixels = NDArray[np.uint8]
Point = tuple[float, float]

WHITE: Colour = (255, 255, 255)
BLACK: Colour = (0, 0, 0)
RED: Colour = (255, 0, 0)
GREEN: Colour = (0, 255, 0)
BLUE: Colour = (0, 0, 255)
YELLOW: Colour = (255, 255, 0)


def make_grey(level: int) -> Colour:
    """Return the colour whose three channels equal ``level``, 0 (black) to 255 (white)."""
    return (level, level, level)


def paint(painter: Painter, paper: Colour = WHITE) -> Pixels:
    """Return a floor image, shape (1143, 2362, 3), with the shapes of ``painter`` on ``paper``."""
    image = Image.new("RGB", (WIDTH, HEIGHT), paper)
    painter(ImageDraw.Draw(image))
    return np.asarray(image)


class SmoothCanvas:
    """Canvas with smooth edges: drawn ``SCALE`` times as large and averaged.

    Coordinates are those of the finished image. Pixel 0 covers 0 to 1.
    """

    def __init__(self, paper: Colour = WHITE) -> None:
        self._image = Image.new("RGB", (WIDTH * SCALE, HEIGHT * SCALE), paper)
        self._canvas: Canvas = ImageDraw.Draw(self._image)

    def line(self, points: Sequence[Point], width: float, colour: Colour = BLACK) -> None:
        """Draw a line ``width`` pixels wide through the points, with round joins."""
        scaled_points = [(round(x * SCALE), round(y * SCALE)) for x, y in points]
        self._canvas.line(scaled_points, colour, width=round(width * SCALE), joint="curve")

    def capsule(self, start: Point, end: Point, radius: float, colour: Colour) -> None:
        """Fill the area within ``radius`` of the line from ``start`` to ``end``."""
        self.line((start, end), 2 * radius, colour)
        for x, y in (start, end):
            self.disc((x, y), radius, colour)

    def disc(self, centre: Point, radius: float, colour: Colour) -> None:
        """Fill a circle; ``radius`` in pixels."""
        x, y = centre
        self.ellipse((x - radius, y - radius, x + radius, y + radius), colour)

    def ring(self, centre: Point, radius: float, width: float, colour: Colour) -> None:
        """Draw a circular line; ``radius`` is measured to the middle of the line."""
        x, y = centre
        outer = radius + width / 2
        box = self._shrink_box((x - outer, y - outer, x + outer, y + outer))
        self._canvas.ellipse(box, outline=colour, width=round(width * SCALE))

    def ellipse(self, box: Box, colour: Colour) -> None:
        """Fill the ellipse inscribed in ``box``: left, top, right, bottom."""
        self._canvas.ellipse(self._shrink_box(box), colour)

    def rectangle(self, box: Box, colour: Colour) -> None:
        """Fill ``box``: left, top, right, bottom."""
        self._canvas.rectangle(self._shrink_box(box), colour)

    def polygon(self, corners: Sequence[Point], colour: Colour) -> None:
        """Fill the polygon with these corners, given in either direction."""
        self._canvas.polygon([(x * SCALE, y * SCALE) for x, y in corners], colour)

    def to_pixels(self) -> Pixels:
        """Return the image, shape (1143, 2362, 3)."""
        return np.asarray(self._image.reduce(SCALE))

    @staticmethod
    def _shrink_box(box: Box) -> Box:
        """Shrink a box by one small pixel at its far edges, because Pillow includes both edges."""
        left, top, right, bottom = box
        return (left * SCALE, top * SCALE, right * SCALE - 1, bottom * SCALE - 1)
