"""Testcard floor: a new drawing of a television test card, 2215 x 1073, in the upper left of white paper.

Unlike the original, the image has no transparent parts, so that no earlier floor shows through.
"""

from __future__ import annotations

from sim.floors.canvas import BLACK, BLUE, GREEN, RED, WHITE, YELLOW, Colour, Pixels, SmoothCanvas, make_grey
from sim.floors.registry import register_floor
from sim.recording import Pose

CARD_WIDTH, CARD_HEIGHT = 2215, 1073

_CYAN: Colour = (0, 255, 255)
_MAGENTA: Colour = (255, 0, 255)
_CENTRE = (CARD_WIDTH / 2, CARD_HEIGHT / 2)


@register_floor("Testcard", Pose(400, 800, 90), menu=12)
def draw_testcard() -> Pixels:
    """Draw a white grid on grey, with colour bars, a grey staircase, fine stripes and a circle."""
    canvas = SmoothCanvas()
    canvas.rectangle((0, 0, CARD_WIDTH, CARD_HEIGHT), make_grey(128))
    _draw_grid(canvas)
    left, right = 407.5, 1807.5
    _draw_bars(canvas, (WHITE, YELLOW, _CYAN, GREEN, _MAGENTA, RED, BLUE, BLACK), left, right, 136.5, 336.5)
    _draw_bars(canvas, tuple(make_grey(255 * step // 10) for step in range(11)), left, right, 336.5, 486.5)
    canvas.rectangle((left, 486.5, right, 586.5), BLACK)
    _draw_stripes(canvas, left, right, 586.5, 736.5)
    _draw_bars(canvas, (RED, BLUE, RED, GREEN, YELLOW, BLUE), left, right, 736.5, 936.5)
    canvas.ring(_CENTRE, 500, 8, WHITE)
    canvas.rectangle((_CENTRE[0] - 350, 496.5, _CENTRE[0] + 350, 576.5), BLACK)
    canvas.line(((_CENTRE[0], 486.5), (_CENTRE[0], 586.5)), 4, WHITE)
    canvas.line(((left, _CENTRE[1]), (right, _CENTRE[1])), 4, WHITE)
    return canvas.to_pixels()


def _draw_grid(canvas: SmoothCanvas) -> None:
    """Draw lines 4 pixels wide, 100 apart, counted from the middle of the card."""
    pitch, width = 100, 4
    for step in range(-11, 12):
        x = _CENTRE[0] + pitch * step
        canvas.line(((x, 0), (x, CARD_HEIGHT)), width, WHITE)
    for step in range(-5, 6):
        y = _CENTRE[1] + pitch * step
        canvas.line(((0, y), (CARD_WIDTH, y)), width, WHITE)


def _draw_bars(
    canvas: SmoothCanvas, colours: tuple[Colour, ...], left: float, right: float, top: float, bottom: float
) -> None:
    width = (right - left) / len(colours)
    for index, colour in enumerate(colours):
        canvas.rectangle((left + width * index, top, left + width * (index + 1), bottom), colour)


def _draw_stripes(canvas: SmoothCanvas, left: float, right: float, top: float, bottom: float) -> None:
    """Draw black and white stripes in five groups, from 20 to 4 pixels wide."""
    group = (right - left) / 5
    canvas.rectangle((left, top, right, bottom), WHITE)
    for index, width in enumerate((20, 16, 12, 8, 4)):
        start = left + group * index
        for stripe in range(int(group / width / 2)):
            stripe_left = start + 2 * width * stripe
            canvas.rectangle((stripe_left, top, stripe_left + width, bottom), BLACK)
