"""How the plain floors are drawn: Pillow shapes at fixed image coordinates (y down, rectangles with both edges).

Only images, and not the tracks, digit sheets and competition mats, which have modules of their own;
default poses, labels and obstacles of the floors are in ``floors.py``.
"""

from __future__ import annotations

import math
from bisect import bisect_left
from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw

#: Size of every floor in mm, and in pixels.
WIDTH, HEIGHT = 2362, 1143

#: Grey of the label patch beside shape k; the course decodes exactly these values.
LABEL_GREYS = tuple(k * 255 // 6 for k in range(6))

Colour = tuple[int, int, int]
Canvas = ImageDraw.ImageDraw
Painter = Callable[[Canvas], None]
Box = tuple[float, float, float, float]

WHITE: Colour = (255, 255, 255)
BLACK: Colour = (0, 0, 0)
RED: Colour = (255, 0, 0)
GREEN: Colour = (0, 255, 0)
BLUE: Colour = (0, 0, 255)
YELLOW: Colour = (255, 255, 0)


def grey(level: int) -> Colour:
    return (level, level, level)


def paint(painter: Painter, background: Colour = WHITE) -> NDArray[np.uint8]:
    """A floor image, shape (1143, 2362, 3), with ``painter``'s shapes on ``background``."""
    image = Image.new("RGB", (WIDTH, HEIGHT), background)
    painter(ImageDraw.Draw(image))
    return np.asarray(image)


def nothing(canvas: Canvas) -> None:
    """Leaves the floor as it is."""


def grey_bands(canvas: Canvas) -> None:
    for left, level in ((250, 220), (650, 211), (1050, 128), (1450, 0)):
        canvas.rectangle((left, 150, left + 200, 900), grey(level))
    for top, colour in ((250, RED), (450, GREEN), (650, BLUE)):
        canvas.ellipse((1850, top, 1950, top + 100), colour)


def coloured_bands(canvas: Canvas) -> None:
    for left, colour in ((250, RED), (650, GREEN), (1050, BLUE), (1450, BLACK)):
        canvas.rectangle((left, 150, left + 200, 750), colour)


def rainbow_bands(canvas: Canvas) -> None:
    colours = (RED, GREEN, BLUE, (0, 255, 255), (255, 0, 255), YELLOW, BLACK)
    for index, colour in enumerate(colours):
        left = 200 + 200 * index
        canvas.rectangle((left, 150, left + 200, 750), colour)


def grey_and_black(canvas: Canvas) -> None:
    canvas.rectangle((200, 100, 1800, 200), BLACK)
    for left, level in ((200, 211), (600, 0), (1000, 220), (1400, 128)):
        canvas.rectangle((left, 600, left + 400, 700), grey(level))


def square(canvas: Canvas) -> None:
    canvas.rectangle((600, 400, 1000, 800), grey(128))
    canvas.rectangle((300, 100, 1300, 1100), outline=grey(128), width=20)


def loop(canvas: Canvas) -> None:
    canvas.rounded_rectangle((200, 200, 1900, 1000), 80, BLACK)
    canvas.rounded_rectangle((300, 300, 1800, 900), 50, WHITE)


def two_shapes(canvas: Canvas) -> None:
    canvas.rounded_rectangle((200, 400, 700, 900), 80, BLACK)
    canvas.rounded_rectangle((300, 500, 600, 800), 50, WHITE)
    canvas.ellipse((1200, 400, 1700, 900), BLACK)
    canvas.ellipse((1300, 500, 1600, 800), WHITE)


def oval(canvas: Canvas, box: Box, colour: Colour) -> None:
    """An ellipse in ``box`` as a polygon of one corner a degree.

    The original Lollipop was drawn so; Pillow's smoother ellipse shifts what a sensor at its rim reads.
    """
    left, top, right, bottom = box
    corners = [
        (
            (left + right + (right - left) * math.cos(math.radians(degree))) / 2,
            (top + bottom + (bottom - top) * math.sin(math.radians(degree))) / 2,
        )
        for degree in range(360)
    ]
    canvas.polygon(corners, colour)


def lollipop(canvas: Canvas) -> None:
    """The line follower's track; wants a background of grey 211."""
    oval(canvas, (400, 371.5, 900, 771.5), BLACK)
    oval(canvas, (420.5, 391, 879.5, 752), grey(211))
    canvas.rectangle((860, 522.5, 920, 593.5), grey(211))
    canvas.arc((878, 549.5, 1078, 644.5), 180, 270, BLACK, width=20)
    canvas.arc((874, 474.5, 1078, 569.5), 90, 180, BLACK, width=20)
    canvas.rectangle((1680, 371.5, 1720, 771.5), YELLOW)
    canvas.rectangle((915, 549.5, 1900, 571.5), BLACK)
    canvas.rectangle((1880, 371.5, 1920, 771.5), RED)


def sensor_diameter_test(canvas: Canvas) -> None:
    for top, lefts, colour in ((200, (200, 240), BLACK), (640, (1000, 1040), RED)):
        for index in range(5):
            thickness = 2 * index
            row = top + 40 * index
            canvas.rectangle((0, row, WIDTH, row + thickness), colour)
            for left in lefts:
                column = left + 78 * index
                canvas.rectangle((column, 0, column + thickness, HEIGHT), colour)
    for x in (200, 240):
        canvas.ellipse((x - 5, 195, x + 5, 205), BLUE)


def shape_outlines(x: float, y: float) -> tuple[tuple[tuple[float, float], ...], ...]:
    """The six shapes of side 10 with their upper left anchor at (x, y), in the order of the codes 0 to 5."""
    s = math.sqrt(3) * 5
    return (
        ((x + 2, y + 2), (x + 8, y + 2), (x + 8, y + 8), (x + 2, y + 8)),
        ((x + 2, y), (x + 2, y + 10), (x + 2 + s, y + 5)),
        ((x, y + 5), (x + s, y), (x + s, y + 10)),
        ((x, y + 2), (x + 5, y + 2 + s), (x + 10, y + 2)),
        ((x, y + 9), (x + 5, y + 9 - s), (x + 10, y + 9)),
        ((x, y + 5), (x + s / 2, y + 10), (x + s, y + 5), (x + s / 2, y)),
    )


#: The codes of the shapes in the course's upper and lower row, from the left.
UPPER_ROW, LOWER_ROW = (0, 1, 2, 3, 4, 5), (1, 5, 0, 2)


def shape_rows(canvas: Canvas, upper: Sequence[int], lower: Sequence[int], *, label_patches: bool) -> None:
    """Six shapes at image row 218, and the unlabelled test row at 418.

    With ``label_patches``, under the right light sensor of each in the upper row is a patch whose grey tells its code.
    """
    for column, code in enumerate(upper):
        draw_shape(canvas, code, 225 + 80 * column, 218)
        if label_patches:
            left = 221 + 80 * column
            canvas.rectangle((left, 251, left + 18, 275), grey(LABEL_GREYS[code]))
    for column, code in enumerate(lower):
        draw_shape(canvas, code, 225 + 80 * column, 418)


def simple_shapes(canvas: Canvas) -> None:
    """The course's shapes, without their patches."""
    shape_rows(canvas, UPPER_ROW, LOWER_ROW, label_patches=False)


def draw_shape(canvas: Canvas, code: int, x: float, y: float) -> None:
    outline = shape_outlines(x, y)[code]
    if code == 0:
        canvas.rectangle((outline[0], outline[2]), BLACK)
    else:
        canvas.polygon(outline, BLACK)


def simple_shapes_with_labels(canvas: Canvas) -> None:
    """The course's shapes with their patches."""
    shape_rows(canvas, UPPER_ROW, LOWER_ROW, label_patches=True)


def linear_grey() -> NDArray[np.uint8]:
    """An even slope from white at image row 100 to black at row 1043, 51 black rows, and white beyond."""
    column = np.full(HEIGHT, 255, dtype=np.uint8)
    for row in range(100, 1043):
        column[row] = 255 - int(255 * (row - 100) / 943)
    column[1043:1094] = 0
    return np.repeat(column[:, None], WIDTH * 3, axis=1).reshape(HEIGHT, WIDTH, 3)


def radial(inner: Colour, outer: Colour) -> NDArray[np.uint8]:
    """From ``inner`` at (1181, 571.5) to ``outer``, by the cube root of distance / (sqrt(2) * 1181).

    The levels fall with the distance, so each is found as the distance at which it ends; a pixel's colour
    then depends on no vectorised power function, which may differ between processors.
    """
    x = 2 * np.arange(WIDTH, dtype=np.int64) - 2362
    y = 2 * np.arange(HEIGHT, dtype=np.int64) - 1143
    quarters = x[None, :] ** 2 + y[:, None] ** 2  # four times the squared distance, a whole number
    channels = [_radial_channel(quarters, low, high) for low, high in zip(outer, inner, strict=True)]
    return np.stack(channels, axis=2)


def _radial_channel(quarters: NDArray[np.int64], outer: int, inner: int) -> NDArray[np.uint8]:
    def darkness(quarter: int) -> int:
        t = (math.sqrt(quarter) / 2 / (math.sqrt(2) * 1181)) ** (1 / 3)
        return inner - int(outer * t + inner * (1 - t))

    furthest = range(int(quarters.max()) + 1)
    starts = [bisect_left(furthest, step, key=darkness) for step in range(1, inner - outer + 1)]
    return (inner - np.searchsorted(starts, quarters, side="right")).astype(np.uint8)
