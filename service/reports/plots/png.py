"""PNG files of drawings and figures: at most 256 colours, no metadata, equal bytes for equal pixels.

Flat plots share a palette: greys, and each colour of the style in steps towards white and towards black lines. Using it
costs a fifth of choosing colours for each plot.
"""

from __future__ import annotations

import io
import math
from collections.abc import Iterator, Mapping, Sequence
from types import MappingProxyType
from typing import TYPE_CHECKING

import numpy as np
from matplotlib.colors import to_hex, to_rgb
from numpy.typing import NDArray
from PIL import Image

from service.reports.plots.drawing import Drawing
from service.reports.plots.plot import DPI
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

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_MAX_DIFFERENCE = 0.5  # of 255, the mean over channels and pixels
_VISIBLE_DIFFERENCE, _MAX_VISIBLE_SHARE = 40, 0.0002  # of 255 in one channel, and the share of channels
_EXAMINED_ROWS = slice(None, None, 7)
_COMPRESSION_LEVEL = 3  # costs half of level 6, for a fifth more bytes
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


def render_png(plot: Drawing | Figure) -> bytes:
    """Return the plot as a PNG."""
    # SVG documents need neither the renderer nor figures.
    from service.reports.plots.raster import rasterise

    stream = io.BytesIO()
    pixels = rasterise(plot) if isinstance(plot, Drawing) else _rasterise_figure(plot)
    _reduce_colours(pixels).save(stream, "PNG", compress_level=_COMPRESSION_LEVEL, dpi=(DPI, DPI))
    return stream.getvalue()


def encode_png(image: Image.Image) -> bytes:
    """Return an RGB image as a PNG."""
    stream = io.BytesIO()
    _reduce_colours(np.asarray(image.convert("RGBA"))).save(stream, "PNG", compress_level=_COMPRESSION_LEVEL)
    return stream.getvalue()


def _rasterise_figure(figure: Figure) -> NDArray[np.uint8]:
    from matplotlib.backends.backend_agg import FigureCanvasAgg

    canvas = FigureCanvasAgg(figure)
    canvas.draw()  # type: ignore[no-untyped-call]
    return np.asarray(canvas.buffer_rgba())  # type: ignore[no-untyped-call]


def _reduce_colours(rgba: NDArray[np.uint8]) -> Image.Image:
    """Return the image with at most 256 colours: those of all plots, or its own ones if these do not suit it."""
    image = Image.fromarray(rgba).convert("RGB")
    reduced_image = image.quantize(palette=PLOT_PALETTE, dither=Image.Dither.NONE)
    before, after = (
        np.asarray(each)[_EXAMINED_ROWS].astype(np.int16) for each in (image, reduced_image.convert("RGB"))
    )
    differences = np.abs(after - before)
    is_similar = differences.mean() < _MAX_DIFFERENCE
    if is_similar and (differences > _VISIBLE_DIFFERENCE).mean() < _MAX_VISIBLE_SHARE:
        return reduced_image
    return _choose_own_colours(rgba)


def _choose_own_colours(rgba: NDArray[np.uint8]) -> Image.Image:
    """Return the image with at most 256 colours, chosen by median cut.

    Plots are flat: their pixels come in runs. Each of their few thousand colours is examined once, weighted by the root
    of its frequency, which costs a fifth of examining every pixel.
    """
    height, width = rgba.shape[:2]
    pixels = np.ascontiguousarray(rgba).view(np.uint32).ravel()
    starts = np.flatnonzero(np.concatenate(([True], pixels[1:] != pixels[:-1])))
    lengths = np.diff(starts, append=pixels.size)
    colours, colour_indices = np.unique(pixels[starts], return_inverse=True)
    weights = np.ceil(np.sqrt(np.bincount(colour_indices, lengths))).astype(np.int64)
    sample = np.repeat(colours, weights).view(np.uint8).reshape(1, -1, 4)[:, :, :3]
    reduced_image = Image.fromarray(sample).quantize(256, method=Image.Quantize.MEDIANCUT, dither=Image.Dither.NONE)
    first_samples = np.cumsum(weights) - weights
    indices = np.asarray(reduced_image).ravel()[first_samples][colour_indices]
    image = Image.fromarray(np.repeat(indices, lengths).reshape(height, width))
    image.putpalette(reduced_image.getpalette() or [])
    return image
