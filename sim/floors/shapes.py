"""Floors with the six shapes: Simple_Shapes as in the course, and Shuffled_Shapes in an order drawn from a seed.

The functions that draw the shapes also return their labels.
"""

from __future__ import annotations

import functools
import math
from collections.abc import Sequence

from sim.floors.canvas import BLACK, Canvas, Pixels, make_grey, paint
from sim.floors.registry import FloorLabel, register_floor, register_seeded_floor
from sim.random_streams import RandomStream
from sim.recording import Pose

#: The six shapes of Simple_Shapes, in the order of the codes 0 to 5 that the course gives them.
SHAPES = (
    "square",
    "right facing triangle",
    "left facing triangle",
    "downwards facing triangle",
    "upwards facing triangle",
    "diamond",
)

#: Grey level of the label patch beside shape k. The course decodes exactly these values.
LABEL_GREYS = tuple(k * 255 // 6 for k in range(6))


def _compute_outlines(x: float, y: float) -> tuple[tuple[tuple[float, float], ...], ...]:
    """Return the six shapes of side 10 with upper left anchor (x, y), in the order of the codes 0 to 5."""
    s = math.sqrt(3) * 5
    return (
        ((x + 2, y + 2), (x + 8, y + 2), (x + 8, y + 8), (x + 2, y + 8)),
        ((x + 2, y), (x + 2, y + 10), (x + 2 + s, y + 5)),
        ((x, y + 5), (x + s, y), (x + s, y + 10)),
        ((x, y + 2), (x + 5, y + 2 + s), (x + 10, y + 2)),
        ((x, y + 9), (x + 5, y + 9 - s), (x + 10, y + 9)),
        ((x, y + 5), (x + s / 2, y + 10), (x + s, y + 5), (x + s / 2, y)),
    )


#: Codes of the shapes in the course's upper and lower row, from the left.
_UPPER_ROW, _LOWER_ROW = (0, 1, 2, 3, 4, 5), (1, 5, 0, 2)


def _draw_rows(canvas: Canvas, upper: Sequence[int], lower: Sequence[int], *, label_patches: bool) -> None:
    """Draw six shapes at image row 218, and the unlabelled test row at row 418.

    With ``label_patches``, the position of the right light sensor beside each shape of the upper row has a grey patch
    that encodes the shape.
    """
    for column, code in enumerate(upper):
        _draw_shape(canvas, code, 225 + 80 * column, 218)
        if label_patches:
            left = 221 + 80 * column
            canvas.rectangle((left, 251, left + 18, 275), make_grey(LABEL_GREYS[code]))
    for column, code in enumerate(lower):
        _draw_shape(canvas, code, 225 + 80 * column, 418)


def _draw_shape(canvas: Canvas, code: int, x: float, y: float) -> None:
    outline = _compute_outlines(x, y)[code]
    if code == 0:
        canvas.rectangle((outline[0], outline[2]), BLACK)
    else:
        canvas.polygon(outline, BLACK)


def _build_labels(upper: Sequence[int], lower: Sequence[int]) -> tuple[FloorLabel, ...]:
    """Return labels that cover 10 mm in each direction from the course's positions of the left sensor.

    Within this area the whole shape is in the sensor's view.
    """
    return tuple(
        FloorLabel(SHAPES[code], 230.0 + 80 * column - 10, y - 10, 20.0, 20.0)
        for y, codes in ((920.0, upper), (720.0, lower))
        for column, code in enumerate(codes)
    )


def _paint_rows(upper: Sequence[int], lower: Sequence[int], *, label_patches: bool) -> Pixels:
    return paint(functools.partial(_draw_rows, upper=upper, lower=lower, label_patches=label_patches))


def _draw_without_patches() -> Pixels:
    return _paint_rows(_UPPER_ROW, _LOWER_ROW, label_patches=False)


@register_floor(
    "Simple_Shapes",
    Pose(800, 400, 0),
    menu=21,
    labels=_build_labels(_UPPER_ROW, _LOWER_ROW),
    unlabelled=_draw_without_patches,
)
def draw_simple_shapes() -> Pixels:
    """Draw the course's shapes and their label patches."""
    return _paint_rows(_UPPER_ROW, _LOWER_ROW, label_patches=True)


@register_seeded_floor("Shuffled_Shapes", Pose(800, 400, 0), label_names=SHAPES)
def draw_shuffled_shapes(seed: int, *, label_patches: bool) -> tuple[Pixels, tuple[FloorLabel, ...]]:
    """Draw each shape once in the upper row, in an order drawn from the seed, and any four shapes in the lower row.

    This floor is not part of the course. It prevents programs from inferring the shape from the robot's position.
    """
    chance = RandomStream(seed, "shapes")
    upper = sorted(_UPPER_ROW, key=chance.integer)
    lower = [chance.integer(100 + column) % len(SHAPES) for column in range(len(_LOWER_ROW))]
    return _paint_rows(upper, lower, label_patches=label_patches), _build_labels(upper, lower)
