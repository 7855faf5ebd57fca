"""Drawing of images from a light sensor: the whole image, the focus that a network gets, and the answer.

Answers were judged during grading. Here they are only shown, with a sign and a word.
"""

from __future__ import annotations

import textwrap
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from service.grading.grade import Prediction
from service.reports.display_text import to_one_line
from service.reports.plots.drawing import Drawing, Rectangle, Stroke, create_drawing
from service.reports.plots.panel import Panel
from service.reports.plots.sensor_images import FOCUS, crop_focus, is_right, select_predictions, to_rgb_image
from service.reports.plots.style import FAULT, HEAD, INK, RULE, SAID, WIDTH

_CARD_WIDTH, _CARD_HEIGHT = 1.93, 1.70
_LINE = 28  # characters in a line under a card
_SIDE = 0.83  # inches, the side of an image
_COLUMNS = 2


def draw_predictions(predictions: Sequence[Prediction], title: str) -> Drawing:
    """Draw cards of at most ``MAX_PREDICTIONS`` images, wrong answers first if not all fit."""
    shown_indices = select_predictions(predictions)
    rows = -(-len(shown_indices) // _COLUMNS)
    height = rows * _CARD_HEIGHT
    drawing = create_drawing(HEAD + height + 0.06, title, _format_subtitle(predictions, shown_indices))
    place = Rectangle(0.02, 0.06, WIDTH - 0.04, height + 0.06)
    panel = Panel(drawing, place, (-0.08, WIDTH - 0.12), (height, -0.06))
    for position, number in enumerate(shown_indices):
        x, y = position % _COLUMNS * _CARD_WIDTH, position // _COLUMNS * _CARD_HEIGHT
        _draw_card(panel, predictions[number], number + 1, x, y)
    return drawing


def _format_subtitle(predictions: Sequence[Prediction], shown_indices: Sequence[int]) -> str:
    wrong_count = sum(not is_right(prediction) for prediction in predictions)
    count = (
        f"{len(predictions)} images"
        if len(shown_indices) == len(predictions)
        else f"{len(shown_indices)} of {len(predictions)} images"
    )
    return f"{count}, {wrong_count} with a wrong answer; each: whole 20×20 image, then its 14×14 part"


def _draw_card(panel: Panel, prediction: Prediction, number: int, x: float, y: float) -> None:
    is_correct = is_right(prediction)
    full_image, focus_image = np.asarray(to_rgb_image(prediction.image)), np.asarray(crop_focus(prediction.image))
    _draw_image(panel, full_image, x, y)
    _draw_image(panel, np.repeat(focus_image[:, :, None], 3, axis=2), x + _SIDE + 0.12, y)
    if prediction.image.side == 20:
        pixel = _SIDE / 20
        corner = (x + FOCUS[0] * pixel, y + FOCUS[1] * pixel)
        panel.add_rectangle(corner, 14 * pixel, 14 * pixel, edge=Stroke(INK, 0.9, (2.25, 1.35)))
    colour = SAID if is_correct else FAULT
    if not is_correct:
        panel.add_rectangle((x - 0.04, y - 0.04), 2 * _SIDE + 0.20, _SIDE + 0.08, edge=Stroke(colour, 1.8))
    sign, verdict = ("✓", "correct") if is_correct else ("✗", "wrong")
    answer = "no answer" if prediction.answer is None else to_one_line(prediction.answer, 30)
    answer_text = f"answer: {answer}" if prediction.answer is not None else answer
    captions = (
        [to_one_line(prediction.truth, 40)]
        if is_correct
        else [answer_text, f"truth: {to_one_line(prediction.truth, 40)}"]
    )
    lines = [(f"{number}. {sign} {verdict}", colour, True)]
    lines += [
        (line, INK, False) for text in captions for line in textwrap.wrap(text, _LINE, max_lines=2, placeholder="…")
    ]
    for row, (text, shade, bold) in enumerate(lines):
        line_y = y + _SIDE + 0.08 + 0.142 * row
        panel.add_text(x, line_y, text, colour=shade, size=8.3, bold=bold, vertical="top")


def _draw_image(panel: Panel, pixels: NDArray[np.uint8], x: float, y: float) -> None:
    panel.add_picture(pixels, x, y, x + _SIDE, y + _SIDE)
    panel.add_rectangle((x, y), _SIDE, _SIDE, edge=Stroke(RULE, 0.8))
