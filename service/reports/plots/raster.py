"""Drawings as pixels: each item is drawn by Matplotlib's Agg renderer, without figures, axes or artists.

Drawing the items directly costs a tenth of the artists' time. Texts are kept as bitmaps, because most of them recur.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np
from matplotlib.backend_bases import GraphicsContextBase
from matplotlib.backends.backend_agg import RendererAgg
from matplotlib.colors import to_rgb
from matplotlib.font_manager import get_font
from matplotlib.ft2font import LoadFlags
from matplotlib.path import Path
from matplotlib.transforms import Affine2D, Bbox
from numpy.typing import NDArray
from PIL import Image

from service.reports.plots.drawing import Area, Drawing, Item, Line, Marks, Picture, Rectangle, Segments, Stroke, Words
from service.reports.plots.plot import DPI
from service.reports.plots.style import BOLD_FONT_FILE, FONT_FILE, INK, MAX_PIXELS, replace_missing_glyphs

_POINTS_PER_INCH = 72
_HATCH = "////"
_BOX_MARGIN = 0.6  # points around a text with a background
_BOX_OPACITY = 0.85
_MAX_KEPT_TEXTS = 512
_MAX_KEPT_LENGTH = 40  # characters; longer texts rarely recur


def rasterise(drawing: Drawing) -> NDArray[np.uint8]:
    """Return the drawing as RGBA, shape (rows, columns, 4). Very large drawings get a lower resolution."""
    dpi = min(float(DPI), math.sqrt(MAX_PIXELS / (drawing.width * drawing.height)))
    raster = _Raster(round(drawing.width * dpi), round(drawing.height * dpi), dpi)
    for item in drawing.items:
        raster.draw(item)
    return raster.get_pixels()


@dataclass(frozen=True, slots=True)
class _Bitmap:
    """The opacity of each pixel of one line of text, and how many of its rows are below the baseline."""

    opacity: NDArray[np.uint8]
    descent: float

    @property
    def width(self) -> int:
        return int(self.opacity.shape[1])

    @property
    def height(self) -> int:
        return int(self.opacity.shape[0])


class _Raster:
    """The pixels of one drawing."""

    def __init__(self, width: int, height: int, dpi: float) -> None:
        # Any, because Matplotlib's renderers have no types.
        self._renderer: Any = RendererAgg(width, height, dpi)  # type: ignore[no-untyped-call]
        self._dpi = dpi
        self._to_pixels = Affine2D().scale(dpi)
        self._draw_box(Rectangle(0, 0, width / dpi, height / dpi), "white", 1.0, None)

    def get_pixels(self) -> NDArray[np.uint8]:
        return np.asarray(self._renderer.buffer_rgba())

    def _to_length(self, points: float) -> float:
        """Return a length in points as pixels."""
        return points * self._dpi / _POINTS_PER_INCH

    def draw(self, item: Item) -> None:
        match item:
            case Line():
                context = self._create_context(item.stroke, item.clip)
                self._renderer.draw_path(context, Path(item.points), self._to_pixels)
            case Segments():
                context = self._create_context(item.stroke, item.clip)
                codes = np.tile((Path.MOVETO, Path.LINETO), len(item.points))
                self._renderer.draw_path(context, Path(item.points.reshape(-1, 2), codes), self._to_pixels)
            case Area():
                self._draw_area(item)
            case Marks():
                self._draw_marks(item)
            case Picture():
                self._draw_picture(item)
            case Words():
                self._draw_words(item)

    def _create_context(self, stroke: Stroke | None, clip: Rectangle | None) -> GraphicsContextBase:
        context: GraphicsContextBase = self._renderer.new_gc()
        if clip is not None:
            scale = self._dpi
            bounds = (clip.left * scale, clip.bottom * scale, clip.width * scale, clip.height * scale)
            context.set_clip_rectangle(Bbox.from_bounds(*bounds))
        if stroke is None:
            context.set_linewidth(0)
            return context
        context.set_foreground((*to_rgb(stroke.colour), stroke.opacity), isRGBA=True)
        context.set_linewidth(stroke.width)
        if stroke.dashes:
            context.set_dashes(0, stroke.dashes)
        else:
            context.set_capstyle("round")
            context.set_joinstyle("round")
        return context

    def _draw_area(self, item: Area) -> None:
        context = self._create_context(item.edge, item.clip)
        if item.edge is not None:
            context.set_joinstyle("miter")
        if item.hatched:
            context.set_hatch(_HATCH)
            context.set_hatch_color(INK)
            context.set_hatch_linewidth(1.0)
        fill = (*to_rgb(item.fill), item.opacity) if item.fill is not None else None
        self._renderer.draw_path(context, _close(item.points), self._to_pixels, fill)

    def _draw_box(self, place: Rectangle, fill: str, opacity: float, clip: Rectangle | None) -> None:
        self._draw_area(Area(place.corners, fill, opacity=opacity, clip=clip))

    def _draw_marks(self, item: Marks) -> None:
        marker = item.marker
        context = self._create_context(item.edge, item.clip)
        context.set_joinstyle(marker.get_joinstyle())
        context.set_capstyle(marker.get_capstyle())
        threshold = marker.get_snap_threshold()
        context.set_snap(threshold is not None and item.size >= threshold)
        transform = Affine2D(marker.get_transform().get_matrix()).scale(self._to_length(item.size))
        fill = (*to_rgb(item.fill), 1.0) if item.fill is not None and marker.is_filled() else None
        self._renderer.draw_markers(context, marker.get_path(), transform, Path(item.points), self._to_pixels, fill)

    def _draw_picture(self, item: Picture) -> None:
        """Draw the image with whole pixels: each pixel of the drawing gets the colour of the nearest one."""
        place, visible = item.place, item.clip or item.place
        left, width = self._cut(place.left, place.width, visible.left, visible.width)
        bottom, height = self._cut(place.bottom, place.height, visible.bottom, visible.height)
        if width <= 0 or height <= 0:
            return
        rows, columns = item.pixels.shape[:2]
        x_scale, y_scale = columns / place.width, rows / place.height
        x, y = left / self._dpi - place.left, place.bottom + place.height - (bottom + height) / self._dpi
        box = (
            max(x * x_scale, 0.0),
            max(y * y_scale, 0.0),
            min((x + width / self._dpi) * x_scale, columns),
            min((y + height / self._dpi) * y_scale, rows),
        )
        image = Image.fromarray(item.pixels).resize((width, height), Image.Resampling.NEAREST, box)
        self._renderer.draw_image(
            self._create_context(None, None), left, bottom, np.asarray(image.convert("RGBA"))[::-1]
        )

    def _cut(self, start: float, size: float, visible_start: float, visible_size: float) -> tuple[int, int]:
        """Return the first pixel and the number of pixels of the visible part along one axis."""
        low = round(max(start, visible_start) * self._dpi)
        return low, round(min(start + size, visible_start + visible_size) * self._dpi) - low

    def _draw_words(self, item: Words) -> None:
        lines = [_render_text(line, item.size, item.bold, self._dpi) for line in item.text.split("\n")]
        x_height = _render_text("lp", item.size, item.bold, self._dpi)
        ascents = [max(line.height - line.descent, x_height.height - x_height.descent) for line in lines]
        step = x_height.height
        width = max(line.width for line in lines)
        ascent = ascents[0]
        descent = step * (len(lines) - 1) + max(lines[-1].descent, x_height.descent)
        below = {
            "baseline": 0.0,
            "top": ascent,
            "middle": ascent / 2,
            "center": (ascent - descent) / 2,
            "bottom": -descent,
        }[item.vertical]
        share = {"left": 0.0, "center": 0.5, "right": 1.0}[item.horizontal]
        x, y = item.x * self._dpi, item.y * self._dpi
        if item.background is not None:
            self._draw_background(item, Rectangle(x - share * width, y - below - descent, width, ascent + descent))
        for number, line in enumerate(lines):
            along, across = -share * line.width, -below - step * number - line.descent
            self._draw_bitmap(line, item, x, y, along, across)

    def _draw_background(self, item: Words, box: Rectangle) -> None:
        margin = self._to_length(_BOX_MARGIN)
        scale = 1 / self._dpi
        place = Rectangle(
            (box.left - margin) * scale,
            (box.bottom - margin) * scale,
            (box.width + 2 * margin) * scale,
            (box.height + 2 * margin) * scale,
        )
        self._draw_box(place, item.background or "white", _BOX_OPACITY, item.clip)

    def _draw_bitmap(self, line: _Bitmap, item: Words, x: float, y: float, along: float, across: float) -> None:
        """Draw one line, ``along`` and ``across`` pixels from the anchor in the direction of the text."""
        opacity = line.opacity
        if not opacity.size:
            return
        rows = opacity.shape[0]
        if item.rotation:
            opacity = np.rot90(opacity)
            left, bottom = round(x - across - rows), round(y + along)
        else:
            left, bottom = round(x + along), round(y + across)
        coloured = np.empty((*opacity.shape, 4), np.uint8)
        coloured[:, :, :3] = [round(255 * channel) for channel in to_rgb(item.colour)]
        coloured[:, :, 3] = opacity[::-1]  # the renderer takes the lowest row first
        self._renderer.draw_image(self._create_context(None, item.clip), left, bottom, coloured)


def _close(points: NDArray[np.float64]) -> Path:
    return Path(np.concatenate((points, points[:1])), closed=True)


def _render_text(text: str, size: float, bold: bool, dpi: float) -> _Bitmap:
    render = _render_new_text if len(text) > _MAX_KEPT_LENGTH else _render_kept_text
    return render(text, size, bold, dpi)


def _render_new_text(text: str, size: float, bold: bool, dpi: float) -> _Bitmap:
    font = get_font(str(BOLD_FONT_FILE if bold else FONT_FILE))
    font.set_size(size, dpi)
    font.set_text(replace_missing_glyphs(text), 0, flags=LoadFlags.NO_HINTING)
    font.draw_glyphs_to_bitmap(antialiased=True)
    return _Bitmap(np.array(font.get_image()), font.get_descent() / 64)


_render_kept_text = lru_cache(maxsize=_MAX_KEPT_TEXTS)(_render_new_text)
