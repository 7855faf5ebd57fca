"""The 256 colours of flat plots: greys, and each colour of the style in steps towards white and towards black lines.

Using them costs a fifth of choosing colours for each plot.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from types import MappingProxyType

import numpy as np
from matplotlib.colors import to_hex, to_rgb
from PIL import Image

from service.reports.plots.style import (
    FAINT,
    FAULT,
    INK,
    LEFT,
    OFF_THE_FLOOR,
    PEN,
    RIGHT,
    RULE,
    SAID,
    SECOND_ROBOT,
    lighten,
)

#: How many steps each colour has on its way to white.
_STEPS_TO_WHITE: Mapping[str, int] = MappingProxyType(
    {INK: 20, FAINT: 14, RULE: 6, LEFT: 24, RIGHT: 20, FAULT: 22, PEN: 12, SAID: 14, SECOND_ROBOT: 14, OFF_THE_FLOOR: 8}
)
_DARKEST_FLOOR = "#484848"  # black, lightened
_STEPS_TO_BLACK_LINES: Mapping[str, int] = MappingProxyType({LEFT: 7, RIGHT: 6, FAULT: 7, SECOND_ROBOT: 5})
#: The colours of tapes and fields on the floors, before they are lightened.
_FLOOR_COLOURS = (
    "#ff0000", "#ffff00", "#00ff00", "#0000ff", "#00ffff", "#ff00ff", "#009640", "#0069b4", "#ffed00", "#e30613",
)  # fmt: skip
_FLOOR_STEPS = 3
_GREYS = 40


def _lighten_colour(colour: str) -> str:
    red, green, blue = (lighten(round(255 * channel)) / 255 for channel in to_rgb(colour))
    return to_hex((red, green, blue))


def _list_colours() -> Iterator[Sequence[float]]:
    yield from ((grey, grey, grey) for grey in np.linspace(0, 1, _GREYS).tolist())
    floor_steps = {_lighten_colour(colour): _FLOOR_STEPS for colour in _FLOOR_COLOURS}
    for end, steps in (("white", floor_steps), ("white", _STEPS_TO_WHITE), (_DARKEST_FLOOR, _STEPS_TO_BLACK_LINES)):
        for colour, count in steps.items():
            for share in np.arange(count) / count:
                yield tuple((1 - share) * np.array(to_rgb(colour)) + share * np.array(to_rgb(end)))


def _build_palette() -> Image.Image:
    colours = np.rint(255 * np.array(list(_list_colours()))).astype(np.uint8)
    # Pillow looks for the nearest colour of the lowest in a cube of 4 x 4 x 4. White must stay the nearest to 252.
    is_white = (colours == 255).all(axis=1)
    distances = np.hypot.reduce(colours.astype(np.float64) - 252, axis=1)
    colours = colours[is_white | (distances > math.sqrt(27))]
    image = Image.new("P", (1, 1))
    image.putpalette(colours.tobytes())
    return image


#: An image that has these colours as its palette.
PLOT_PALETTE = _build_palette()
