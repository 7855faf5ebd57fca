"""Drawing of misread images, each beside the nearest correctly read ones.

``sensor_images.py`` selects them.
"""

from __future__ import annotations

import textwrap
from collections.abc import Sequence

import numpy as np

from service.grading.grade import Prediction
from service.reports.display_text import to_one_line
from service.reports.plots.drawing import Drawing, Horizontal, Rectangle, Stroke, create_drawing
from service.reports.plots.panel import Panel
from service.reports.plots.sensor_images import MAX_MISREAD, MisreadImage, crop_focus
from service.reports.plots.style import FAINT, FAULT, HEAD, INK, RULE, SAID, WIDTH

_SIDE, _GAP, _ROW = 0.76, 0.10, 1.24  # inches
_HEADS = 0.34
_TEXT = 3 * (_SIDE + _GAP) + 0.08


def draw_misread(misread_images: Sequence[MisreadImage], image_count: int, title: str) -> Drawing:
    """Draw at most ``MAX_MISREAD`` rows: the image, and the nearest correct ones of its truth and of its answer."""
    shown_images = misread_images[:MAX_MISREAD]
    height = _ROW * len(shown_images)
    count = (
        f"{len(shown_images)} of {len(misread_images)}"
        if len(shown_images) < len(misread_images)
        else str(len(misread_images))
    )
    drawing = create_drawing(
        HEAD + _HEADS + height,
        title,
        f"{count} misread of n = {image_count} images; each: the part that a network receives",
    )
    place = Rectangle(0.02, 0.0, WIDTH - 0.04, height + _HEADS)
    panel = Panel(drawing, place, (-0.08, WIDTH - 0.12), (height, -_HEADS))
    for column, heading in enumerate(("misread", "correct,\nsame truth", "correct,\nsame answer")):
        _write(panel, column * (_SIDE + _GAP) + _SIDE / 2, -0.5 * _HEADS, heading, FAINT, 8, horizontal="center")
    for row, item in enumerate(shown_images):
        _draw_row(panel, item, row * _ROW)
    return drawing


def _draw_row(panel: Panel, item: MisreadImage, y: float) -> None:
    _draw_image(panel, item.prediction, 0, y, FAULT, 1.8)
    for column, neighbour in ((1, item.like_truth), (2, item.like_answer)):
        if neighbour is None:
            _write(panel, column * (_SIDE + _GAP) + _SIDE / 2, y + _SIDE / 2, "none", FAINT, 8, horizontal="center")
        else:
            _draw_image(panel, neighbour, column * (_SIDE + _GAP), y, RULE, 0.8)
    lines = [
        (f"{item.number}. ✗ wrong", FAULT, True),
        ("truth:", FAINT, False),
        (to_one_line(item.prediction.truth, 40), INK, False),
        ("answered:", FAINT, False),
        (to_one_line(item.prediction.answer or "", 40), INK, False),
    ]
    line = 0
    for text, colour, bold in lines:
        for text_line in textwrap.wrap(text, 16, max_lines=2, placeholder="…") or [""]:
            _write(panel, _TEXT, y + 0.08 + 0.145 * line, text_line, colour, 8.2, bold=bold)
            line += 1
    for column, neighbour in ((1, item.like_truth), (2, item.like_answer)):
        if neighbour is not None:
            name = textwrap.shorten(to_one_line(neighbour.truth, 40), 14, placeholder="…")
            _write(panel, column * (_SIDE + _GAP) + _SIDE / 2, y + _SIDE + 0.1, name, SAID, 7.2, horizontal="center")


def _draw_image(panel: Panel, prediction: Prediction, x: float, y: float, colour: str, width: float) -> None:
    pixels = np.repeat(np.asarray(crop_focus(prediction.image))[:, :, None], 3, axis=2)
    panel.add_picture(pixels, x, y, x + _SIDE, y + _SIDE)
    panel.add_rectangle((x, y), _SIDE, _SIDE, edge=Stroke(colour, width))


def _write(
    panel: Panel, x: float, y: float, text: str, colour: str, size: float,
    *, horizontal: Horizontal = "left", bold: bool = False,
) -> None:  # fmt: skip
    panel.add_text(x, y, text, colour=colour, size=size, bold=bold, horizontal=horizontal, vertical="center")
