"""Plain floors: bands, gradients, loops and simple outlines, in image coordinates (both edges included).

Shapes, tracks, digit sheets, the test card and competition mats are in other modules.
"""

from __future__ import annotations

import math
from bisect import bisect_left
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from sim.floors.canvas import (
    BLACK,
    BLUE,
    GREEN,
    HEIGHT,
    RED,
    WHITE,
    WIDTH,
    YELLOW,
    Box,
    Canvas,
    Colour,
    Painter,
    Pixels,
    make_grey,
    paint,
)
from sim.floors.registry import register_floor
from sim.recording import Pose


def register_painted_floor(name: str, pose: Pose, *, menu: int, paper: Colour = WHITE) -> Callable[[Painter], Painter]:
    """Return a decorator that registers the floor drawn by a painter on ``paper``."""

    def register(painter: Painter) -> Painter:
        register_floor(name, pose, menu=menu)(lambda: paint(painter, paper))
        return painter

    return register


@register_painted_floor("Empty_Map", Pose(100, 800, 0), menu=1)
def draw_nothing(canvas: Canvas) -> None:
    """Draw nothing."""


@register_painted_floor("Grey_bands", Pose(150, 500, 0), menu=4)
def draw_grey_bands(canvas: Canvas) -> None:
    """Draw four vertical bands, three grey and one black, and to their right a red, a green and a blue disc."""
    for left, level in ((250, 220), (650, 211), (1050, 128), (1450, 0)):
        canvas.rectangle((left, 150, left + 200, 900), make_grey(level))
    for top, colour in ((250, RED), (450, GREEN), (650, BLUE)):
        canvas.ellipse((1850, top, 1950, top + 100), colour)


@register_painted_floor("Coloured_bands", Pose(100, 800, 0), menu=8)
def draw_coloured_bands(canvas: Canvas) -> None:
    """Draw four separate vertical bands: red, green, blue and black."""
    for left, colour in ((250, RED), (650, GREEN), (1050, BLUE), (1450, BLACK)):
        canvas.rectangle((left, 150, left + 200, 750), colour)


@register_painted_floor("Rainbow_bands", Pose(100, 800, 0), menu=9)
def draw_rainbow_bands(canvas: Canvas) -> None:
    """Draw seven adjacent vertical bands: red, green, blue, cyan, magenta, yellow and black."""
    colours = (RED, GREEN, BLUE, (0, 255, 255), (255, 0, 255), YELLOW, BLACK)
    for index, colour in enumerate(colours):
        left = 200 + 200 * index
        canvas.rectangle((left, 150, left + 200, 750), colour)


@register_painted_floor("Grey_and_black", Pose(400, 700, 90), menu=10)
def draw_grey_and_black(canvas: Canvas) -> None:
    """Draw a black strip near the top, and below it a strip with three greys and black."""
    canvas.rectangle((200, 100, 1800, 200), BLACK)
    for left, level in ((200, 211), (600, 0), (1000, 220), (1400, 128)):
        canvas.rectangle((left, 600, left + 400, 700), make_grey(level))


@register_painted_floor("Square", Pose(550, 300, -90), menu=13)
def draw_square(canvas: Canvas) -> None:
    """Draw a grey square inside the grey outline of a larger square."""
    canvas.rectangle((600, 400, 1000, 800), make_grey(128))
    canvas.rectangle((300, 100, 1300, 1100), outline=make_grey(128), width=20)


@register_painted_floor("Loop", Pose(500, 500, 90), menu=2)
def draw_loop(canvas: Canvas) -> None:
    """Draw a black track with rounded corners, 100 pixels wide."""
    canvas.rounded_rectangle((200, 200, 1900, 1000), 80, BLACK)
    canvas.rounded_rectangle((300, 300, 1800, 900), 50, WHITE)


@register_painted_floor("Two_shapes", Pose(200, 500, 90), menu=3)
def draw_two_shapes(canvas: Canvas) -> None:
    """Draw thick black outlines: a rounded square and, to its right, a circle."""
    canvas.rounded_rectangle((200, 400, 700, 900), 80, BLACK)
    canvas.rounded_rectangle((300, 500, 600, 800), 50, WHITE)
    canvas.ellipse((1200, 400, 1700, 900), BLACK)
    canvas.ellipse((1300, 500, 1600, 800), WHITE)


def _draw_oval(canvas: Canvas, box: Box, colour: Colour) -> None:
    """Draw the ellipse in ``box`` as a polygon with one corner per degree.

    The original Lollipop uses this polygon. Pillow's smoother ellipse would change sensor readings at the edge.
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


@register_painted_floor("Lollipop", Pose(750, 375, -180), menu=11, paper=make_grey(211))
def draw_lollipop(canvas: Canvas) -> None:
    """Draw the line follower's track."""
    _draw_oval(canvas, (400, 371.5, 900, 771.5), BLACK)
    _draw_oval(canvas, (420.5, 391, 879.5, 752), make_grey(211))
    canvas.rectangle((860, 522.5, 920, 593.5), make_grey(211))
    canvas.arc((878, 549.5, 1078, 644.5), 180, 270, BLACK, width=20)
    canvas.arc((874, 474.5, 1078, 569.5), 90, 180, BLACK, width=20)
    canvas.rectangle((1680, 371.5, 1720, 771.5), YELLOW)
    canvas.rectangle((915, 549.5, 1900, 571.5), BLACK)
    canvas.rectangle((1880, 371.5, 1920, 771.5), RED)


@register_painted_floor("Sensor_Diameter_Test", Pose(550, 450, 90), menu=20)
def draw_sensor_diameter_test(canvas: Canvas) -> None:
    """Draw black and red lines, horizontal and vertical, each 1, 3, 5, 7 and 9 pixels wide, and two blue dots."""
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


@register_floor("Linear_grey", Pose(200, 50, 90), menu=5)
def draw_linear_grey() -> Pixels:
    """Draw a linear gradient from white at image row 100 to black at row 1043, 51 black rows, and white below."""
    column = np.full(HEIGHT, 255, dtype=np.uint8)
    for row in range(100, 1043):
        column[row] = 255 - int(255 * (row - 100) / 943)
    column[1043:1094] = 0
    return np.repeat(column[:, None], WIDTH * 3, axis=1).reshape(HEIGHT, WIDTH, 3)


@register_floor("Radial_grey", Pose(100, 400, 0), menu=6)
def draw_radial_grey() -> Pixels:
    """Draw a radial gradient from white in the middle to black at the corners."""
    return _draw_radial_gradient(inner_colour=WHITE, outer_colour=BLACK)


@register_floor("Radial_red", Pose(100, 400, 0), menu=7)
def draw_radial_red() -> Pixels:
    """Draw a radial gradient from light red in the middle to dark red at the corners."""
    return _draw_radial_gradient(inner_colour=(255, 80, 80), outer_colour=(80, 0, 0))


def _draw_radial_gradient(inner_colour: Colour, outer_colour: Colour) -> Pixels:
    """Draw a gradient from ``inner_colour`` at (1181, 571.5) to ``outer_colour``.

    The shade is the cube root of distance / (sqrt(2) * 1181).

    The levels decrease with the distance, so the code computes the distance at which each level ends. Colours then
    don't depend on a vectorised power function, which may differ between processors.
    """
    x = 2 * np.arange(WIDTH, dtype=np.int64) - 2362
    y = 2 * np.arange(HEIGHT, dtype=np.int64) - 1143
    squared_diameters = x[None, :] ** 2 + y[:, None] ** 2  # four times the squared distance, an integer
    channels = [
        _compute_radial_channel(squared_diameters, low, high)
        for low, high in zip(outer_colour, inner_colour, strict=True)
    ]
    return np.stack(channels, axis=2)


def _compute_radial_channel(squared_diameters: NDArray[np.int64], outer_level: int, inner_level: int) -> Pixels:
    def compute_darkness(quarter: int) -> int:
        t = (math.sqrt(quarter) / 2 / (math.sqrt(2) * 1181)) ** (1 / 3)
        return inner_level - int(outer_level * t + inner_level * (1 - t))

    furthest = range(int(squared_diameters.max()) + 1)
    starts = [bisect_left(furthest, step, key=compute_darkness) for step in range(1, inner_level - outer_level + 1)]
    return (inner_level - np.searchsorted(starts, squared_diameters, side="right")).astype(np.uint8)
