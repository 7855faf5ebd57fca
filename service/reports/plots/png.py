"""PNG files of drawings and figures: at most 256 colours, no metadata, equal bytes for equal pixels."""

from __future__ import annotations

import io
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from service.reports.plots.drawing import Drawing
from service.reports.plots.palette import PLOT_PALETTE
from service.reports.plots.plot import DPI

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_MAX_DIFFERENCE = 0.5  # of 255, the mean over channels and pixels
_VISIBLE_DIFFERENCE, _MAX_VISIBLE_SHARE = 40, 0.0002  # of 255 in one channel, and the share of channels
_EXAMINED_ROWS = slice(None, None, 7)
_COMPRESSION_LEVEL = 3  # costs half of level 6, for a fifth more bytes


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
