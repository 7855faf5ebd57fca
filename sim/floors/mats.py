"""Simplified competition mats. Features that activities use are at their positions on the real mats.

The images are new drawings in image coordinates (y down). Other details are not exact.
"""

from __future__ import annotations

import itertools
import math

from sim.floors.canvas import (
    BLACK,
    BLUE,
    HEIGHT,
    RED,
    WHITE,
    WIDTH,
    Box,
    Colour,
    Pixels,
    Point,
    SmoothCanvas,
    make_grey,
)
from sim.floors.registry import register_floor
from sim.random_streams import RandomStream
from sim.recording import Pose

#: Bars of Into Orbit that a robot must not cross: both ends, and the radius with the white border.
ORBIT_BARS: tuple[tuple[Point, Point, float], ...] = (
    ((900, 622), (1140, 570), 33),
    ((1020, 600), (1096, 945), 36),
    ((1474, 512), (1724, 512), 33),
    ((1600, 512), (1600, 868), 36),
    ((1419, 932), (1419, 1143), 33),
    ((1252, 0), (1252, 216), 33),
    ((0, 245), (212, 245), 33),
)
ORBIT_BORDER = 10.0
ORBIT_SATELLITE: Point = (1256, 720)
ORBIT_MOON_BASE: Point = (2183, 189)
ORBIT_MOON_BASE_RADIUS = 69.0
ORBIT_ASTEROID: Box = (486, 16, 926, 600)

#: Targets of the WRO 2018 mat: both edges and the colour of each.
WRO_2018_TARGETS: tuple[tuple[Box, Colour], ...] = (
    ((295, 438, 414, 702), (255, 237, 0)),
    ((1950, 438, 2070, 701), (227, 6, 19)),
    ((1049, 96, 1313, 215), (0, 150, 64)),
)
WRO_2018_BASE: Box = (752, 842, 1610, 1142)

_CELL_GREY: Colour = (201, 200, 199)
_WRO_BLACK: Colour = (35, 31, 32)
_WRO_BLUE: Colour = (0, 105, 180)


@register_floor("FLL_2018_Into_Orbit", Pose(150, 150, 90), menu=17)
def draw_fll_2018() -> Pixels:
    """Draw space with a satellite, a moon base, an asteroid, and bordered black bars as obstacles."""
    canvas = SmoothCanvas((18, 24, 58))
    _draw_stars(canvas)
    canvas.disc((0, HEIGHT), 420, (52, 66, 120))
    canvas.ring((0, HEIGHT), 420, 8, WHITE)
    canvas.disc((WIDTH, 0), 460, (168, 166, 160))
    for centre, size in (((2010, 90), 38), ((2290, 330), 46), ((2040, 250), 26), ((2330, 60), 30)):
        canvas.disc(centre, size, (140, 138, 132))
    canvas.disc(ORBIT_MOON_BASE, ORBIT_MOON_BASE_RADIUS, (226, 120, 40))
    canvas.ring(ORBIT_MOON_BASE, ORBIT_MOON_BASE_RADIUS - 4, 8, WHITE)
    _draw_asteroid(canvas)
    for inset, colour in ((0.0, WHITE), (ORBIT_BORDER, BLACK)):
        for start, end, radius in ORBIT_BARS:
            canvas.capsule(start, end, radius - inset, colour)
    _draw_satellite(canvas)
    return canvas.to_pixels()


def _draw_stars(canvas: SmoothCanvas) -> None:
    chance = RandomStream(2018, "stars")
    for star in range(160):
        centre = (chance.between(0, WIDTH, star, 0), chance.between(0, HEIGHT, star, 1))
        canvas.disc(centre, chance.between(1, 3, star, 2), make_grey(150 + chance.integer(star, 3) % 90))


def _draw_asteroid(canvas: SmoothCanvas) -> None:
    """Draw an irregular rock that fills its box."""
    left, top, right, bottom = ORBIT_ASTEROID
    middle, half = ((left + right) / 2, (top + bottom) / 2), ((right - left) / 2, (bottom - top) / 2)
    rim = []
    for degree in range(0, 360, 3):
        angle = math.radians(degree)
        lump = 0.94 + 0.06 * math.cos(4 * angle)
        rim.append((middle[0] + half[0] * lump * math.cos(angle), middle[1] + half[1] * lump * math.sin(angle)))
    canvas.polygon(rim, (116, 96, 80))
    for centre, radius in (((610, 170), 44), ((780, 260), 60), ((660, 430), 52), ((800, 470), 30), ((740, 110), 26)):
        canvas.disc(centre, radius, (92, 75, 62))


def _draw_satellite(canvas: SmoothCanvas) -> None:
    """Draw a body between two solar panels, on a light disc."""
    x, y = ORBIT_SATELLITE
    canvas.ring(ORBIT_SATELLITE, 78, 6, WHITE)
    for left in (x - 66, x + 22):
        canvas.rectangle((left, y - 18, left + 44, y + 18), (60, 120, 210))
        canvas.line(((left + 22, y - 18), (left + 22, y + 18)), 2, WHITE)
    canvas.rectangle((x - 18, y - 26, x + 18, y + 26), (214, 180, 90))


@register_floor("FLL_2019_City_Shaper", Pose(500, 150, 90), menu=16)
def draw_fll_2019() -> Pixels:
    """Draw a city plan freely: launch area, streets with bordered black lines, building circles and a bridge."""
    canvas = SmoothCanvas((226, 222, 208))
    for left, top, right, bottom in (
        (120, 90, 520, 380), (620, 90, 1000, 380), (1500, 480, 1800, 760), (1900, 480, 2260, 760),
        (1240, 880, 1640, 1080),
    ):  # fmt: skip
        canvas.rectangle((left, top, right, bottom), (206, 214, 190))
    canvas.disc((0, HEIGHT), 720, (250, 250, 246))
    canvas.ring((0, HEIGHT), 720, 8, (90, 96, 110))
    canvas.rectangle((1120, 400, 1400, 620), (172, 178, 190))
    for x in range(1160, 1400, 40):
        canvas.line(((x, 400), (x, 620)), 4, (140, 146, 160))
    streets: tuple[tuple[Point, ...], ...] = (
        ((300, 440), (1060, 440)),
        ((1060, 120), (1060, 700), (1840, 820), (2240, 820)),
        ((1440, 300), (2240, 300)),
        ((1840, 300), (1840, 820)),
    )
    for border, colour in ((33.0, WHITE), (23.0, BLACK)):
        for street in streets:
            for start, end in itertools.pairwise(street):
                canvas.capsule(start, end, border, colour)
    for centre, colour in (
        ((320, 230), RED), ((810, 230), BLUE), ((1620, 150), (255, 210, 0)), ((2060, 150), (0, 150, 64)),
        ((2080, 620), (120, 60, 150)), ((1440, 980), (240, 130, 30)),
    ):  # fmt: skip
        canvas.disc(centre, 90, WHITE)
        canvas.disc(centre, 78, colour)
    return canvas.to_pixels()


@register_floor("WRO_2018_Regular_Junior", Pose(1181, 150, 90), menu=15)
def draw_wro_2018() -> Pixels:
    """Draw a blue base, three coloured targets of three cells, and black lines from the base to each target."""
    canvas = SmoothCanvas()
    width = 20
    yellow, red, green = (box for box, _ in WRO_2018_TARGETS)
    middle, crossing, row = 1181.0, 570.0, 842.0
    for points in (
        ((middle, row), (middle, green[3])),
        ((yellow[2], crossing), (red[0], crossing)),
        ((yellow[2] + 200, crossing), (yellow[2] + 200, 330), (yellow[2] + 200, 155), (green[0], 155)),
        ((red[0] - 200, crossing), (red[0] - 200, 155), (green[2], 155)),
    ):
        canvas.line(points, width, _WRO_BLACK)
    canvas.rectangle(_include_far_edges(WRO_2018_BASE), _WRO_BLUE)
    canvas.rectangle((902, 992, 1461, 1143), WHITE)
    for box, colour in WRO_2018_TARGETS:
        canvas.rectangle(_include_far_edges(box), colour)
        for cell in _split_into_cells(box):
            canvas.rectangle(cell, _CELL_GREY)
    return canvas.to_pixels()


@register_floor("WRO_2019_Regular_Junior", Pose(2215, 150, 90), menu=14)
def draw_wro_2019() -> Pixels:
    """Draw a start area at the lower right, black lines, and rows of coloured cells, all freely."""
    canvas = SmoothCanvas()
    width = 20
    for points in (
        ((2215, 850), (2215, 571), (180, 571)),
        ((420, 571), (420, 230)),
        ((1000, 571), (1000, 230)),
        ((1580, 571), (1580, 230)),
        ((700, 571), (700, 900)),
        ((1400, 571), (1400, 900)),
    ):
        canvas.line(points, width, _WRO_BLACK)
    canvas.rectangle((2065, 843, 2362, 1143), (0, 150, 64))
    canvas.rectangle((2115, 893, 2315, 1093), WHITE)
    colours = ((227, 6, 19), (255, 237, 0), _WRO_BLUE)
    for left, colour in zip((288, 868, 1448), colours, strict=True):
        target = (left, 110, left + 264, 229)
        canvas.rectangle(target, colour)
        for cell in _split_into_cells(target):
            canvas.rectangle(cell, _CELL_GREY)
    for left in (600, 1300):
        canvas.rectangle((left, 900, left + 200, 1060), _CELL_GREY)
        canvas.rectangle((left + 20, 920, left + 180, 1040), WHITE)
    canvas.rectangle((80, 471, 180, 671), _WRO_BLUE)
    return canvas.to_pixels()


def _include_far_edges(box: Box) -> Box:
    """Return the box with the far edges of its last pixels."""
    left, top, right, bottom = box
    return (left, top, right + 1, bottom + 1)


def _split_into_cells(box: Box) -> tuple[Box, ...]:
    """Return three squares of side 60, spaced evenly along the longer side of ``box``."""
    left, top, right, bottom = _include_far_edges(box)
    side, middle = 60, ((left + right) / 2, (top + bottom) / 2)
    third = max(right - left, bottom - top) / 3
    steps = (-third, 0, third)
    if right - left > bottom - top:
        centres = [(middle[0] + step, middle[1]) for step in steps]
    else:
        centres = [(middle[0], middle[1] + step) for step in steps]
    return tuple((x - side / 2, y - side / 2, x + side / 2, y + side / 2) for x, y in centres)
