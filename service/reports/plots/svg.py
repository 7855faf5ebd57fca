"""Drawings as SVG documents for reports: sharp at any size, and readable on a dark page.

A document is complete in itself: no scripts, no references to other files. Its style only changes colours for dark
pages. Coordinates are whole thousandths of an inch, from the upper left corner.
"""

from __future__ import annotations

import base64
import io
import math
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from html import escape
from itertools import groupby
from types import MappingProxyType

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from service.reports.plots.drawing import (
    Area,
    Drawing,
    Item,
    Line,
    Marks,
    Picture,
    Points,
    Rectangle,
    Segments,
    Stroke,
    Words,
)
from service.reports.plots.png import encode_png
from service.reports.plots.style import FAINT, FAULT, INK, LEFT, RIGHT, RULE, SAID, SECOND_ROBOT
from service.reports.plots.svg_paths import UNITS, simplify_line, write_circle, write_path

#: The width and height of a document in CSS pixels for each inch: 8 point type is 11 pixels high.
PIXELS_PER_INCH = 100
_POINT = UNITS / 72
_FAR = 100_000  # units; coordinates beyond are outside every drawing
_PICTURE_PIXELS = 200  # per inch; larger pictures are reduced
_MAX_FLAT_COLOURS, _PHOTOGRAPH_QUALITY = 4096, 75
_BLOCKS = 60  # pixels per inch; the pixels of smaller pictures stay visible squares
_MIN_SHARED_LENGTH = 200  # characters of a line that is drawn twice and written once
_HATCH_STEP, _HATCH_WIDTH = 84, 14  # units
_HALO = 3  # points around a text with a background
_JOINERS = "\u200c\u200d"
#: The type's measures in parts of its size.
_ASCENT, _DESCENT, _LINE_STEP = 0.76, 0.21, 0.97
#: Colours on the page itself, and their replacements on a dark one. Whatever has a light ground keeps its colours.
_DARK_COLOURS: Mapping[str, str] = MappingProxyType(
    {
        INK: "#e6eaee",
        FAINT: "#a3afba",
        RULE: "#4a555f",
        LEFT: "#7db8f0",
        RIGHT: "#f0a050",
        FAULT: "#ff8a98",
        SAID: "#86c993",
        SECOND_ROBOT: "#cf9ff0",
    }
)
_DARK_PAPER = "#14191e"
_ANCHORS = MappingProxyType({"left": "", "center": "middle", "right": "end"})


def render_svg(drawing: Drawing, title: str) -> str:
    """Return the drawing as an SVG document, the same for the same drawing."""
    return _Document(drawing).render(title)


@dataclass(frozen=True, slots=True)
class _Element:
    """One element, with the group that it belongs to. ``body`` is the text in it."""

    tag: str
    attributes: str
    clip: Rectangle | None
    is_on_paper: bool
    path: str = ""  # of a path's ``d``
    body: str = ""


@dataclass(slots=True)
class _Document:
    """The elements of one drawing. ``grounds`` are the parts of the page that are covered, so that they stay light."""

    drawing: Drawing
    elements: list[_Element] = field(default_factory=list)
    grounds: list[Rectangle] = field(default_factory=list)

    def render(self, title: str) -> str:
        for item in self.drawing.items:
            self._add(item)
        width, height = (round(size * PIXELS_PER_INCH) for size in (self.drawing.width, self.drawing.height))
        right, bottom = _to_units(self.drawing.width), _to_units(self.drawing.height)
        body = "".join(self._write_groups())
        return (
            f"<svg xmlns='http://www.w3.org/2000/svg' width='{width}' height='{height}' viewBox='0 0 {right} {bottom}' "
            "fill='none' stroke-linecap='round' stroke-linejoin='round' font-family='DejaVu Sans,Verdana,sans-serif'>"
            f"<title>{_escape(title)}</title>{_write_style(body)}"
            f"<path class='page' fill='#fff' d='M0 0h{right}v{bottom}H0z'/>{body}</svg>"
        )

    def _write_groups(self) -> Iterator[str]:
        """Yield definitions, then the elements in groups with the same clip and ground."""
        counts = Counter(element.path for element in self.elements if len(element.path) > _MIN_SHARED_LENGTH)
        shared_paths = {path: f"p{number}" for number, path in enumerate(p for p, count in counts.items() if count > 1)}
        clips = dict.fromkeys(element.clip for element in self.elements if element.clip is not None)
        clip_names = {clip: f"c{number}" for number, clip in enumerate(clips)}
        definitions = [f"<path id='{name}' d='{path}'/>" for path, name in shared_paths.items()]
        definitions += [
            f"<clipPath id='{name}'><path d='{self._trace(clip.corners)}z'/></clipPath>"
            for clip, name in clip_names.items()
        ]
        if any("url(#hatch)" in element.attributes for element in self.elements):
            definitions.append(_write_hatch())
        if definitions:
            yield f"<defs>{''.join(definitions)}</defs>"
        for (clip, is_on_paper), elements in groupby(self.elements, lambda each: (each.clip, each.is_on_paper)):
            ground = " class='ink'" if is_on_paper else ""
            cut = "" if clip is None else f" clip-path='url(#{clip_names[clip]})'"
            written_elements = "".join(_write_element(element, shared_paths) for element in elements)
            yield f"<g{ground}{cut}>{written_elements}</g>" if ground or cut else written_elements

    def _add(self, item: Item) -> None:
        match item:
            case Line():
                self._add_path(self._trace_line(item), _write_stroke(item.stroke), item)
            case Segments():
                path = "".join(self._trace(pair) for pair in item.points)
                self._add_path(path, _write_stroke(item.stroke), item)
            case Area():
                self._add_area(item)
            case Marks():
                self._add_marks(item)
            case Picture():
                self._add_picture(item)
            case Words():
                self._add_words(item)

    def _add_path(self, path: str, attributes: str, item: Item) -> None:
        if path:
            self.elements.append(_Element("path", attributes, item.clip, self._is_on_paper(item), path))

    def _is_on_paper(self, item: Item) -> bool:
        """Return whether any of the item is drawn on the page itself, which is dark on a dark page."""
        extent = _measure_extent(item)
        return not any(ground.contains(extent) for ground in self.grounds)

    def _to_page(self, points: Points) -> Points:
        """Return the points in units from the upper left corner, none of them far outside."""
        flipped_points = np.column_stack((points[:, 0], self.drawing.height - points[:, 1])) * UNITS
        return np.clip(flipped_points, -_FAR, _FAR)

    def _trace(self, points: Points) -> str:
        """Return the data of an open path through the points."""
        return write_path(self._to_page(points))

    def _trace_line(self, item: Line) -> str:
        return "".join(write_path(run) for run in simplify_line(self._to_page(item.points)))

    def _add_area(self, item: Area) -> None:
        attributes = _write_stroke(item.edge, join="miter") if item.edge is not None else ""
        if item.fill is not None:
            attributes += f" fill='{item.fill}'"
            if item.opacity < 1:
                attributes += f" fill-opacity='{item.opacity:g}'"
        open_path = self._trace(item.points)
        path = f"{open_path}z" if open_path else ""
        ground = _find_ground(item)
        if ground is not None:
            # The ground keeps its colour on a dark page, and everything on it.
            self.grounds.append(ground)
        self._add_path(path, attributes, item)
        if item.hatched:
            self._add_path(path, " fill='url(#hatch)'", item)

    def _add_marks(self, item: Marks) -> None:
        stroke = _write_stroke(item.edge, join="miter") if item.edge is not None else ""
        fill = f" fill='{item.fill}'" if item.fill is not None and item.marker.is_filled() else ""
        size = item.size * _POINT
        centres = self._to_page(item.points[np.isfinite(item.points).all(axis=1)])
        if item.marker.get_marker() == "o":
            path = "".join(write_circle(x, y, size / 2) for x, y in centres)
        else:
            outline = item.marker.get_path().transformed(item.marker.get_transform())
            parts = [np.asarray(part) * (size, -size) for part in outline.to_polygons(closed_only=False)]
            end = "z" if item.marker.is_filled() else ""
            path = "".join(write_path(part + centre) + end for centre in centres for part in parts)
        self._add_path(path, stroke + fill, item)

    def _add_picture(self, item: Picture) -> None:
        place, pixels = _cut_picture(item)
        if not pixels.size:
            return
        density = pixels.shape[1] / place.width
        factor = max(1, round(density / _PICTURE_PIXELS))
        image = Image.fromarray(np.ascontiguousarray(pixels))
        uri = _encode_picture(image.reduce(factor) if factor > 1 else image)
        left, top = _to_units(place.left), _to_units(self.drawing.height - place.bottom - place.height)
        attributes = (
            f" x='{left}' y='{top}' width='{_to_units(place.width)}' height='{_to_units(place.height)}' "
            f"preserveAspectRatio='none' href='{uri}'"
        )
        if density < _BLOCKS:
            attributes += " image-rendering='pixelated'"
        self.grounds.append(item.place.cut(item.clip))
        self.elements.append(_Element("image", attributes, item.clip, is_on_paper=False))

    def _add_words(self, item: Words) -> None:
        lines = item.text.split("\n")
        ascent, descent = _ASCENT, _LINE_STEP * (len(lines) - 1) + _DESCENT
        below = {
            "baseline": 0.0,
            "top": ascent,
            "middle": ascent / 2,
            "center": (ascent - descent) / 2,
            "bottom": -descent,
        }[item.vertical]
        size = item.size * _POINT
        x, y = item.x * UNITS, (self.drawing.height - item.y) * UNITS
        common_attributes = f" font-size='{round(size)}' fill='{item.colour}'"
        anchor = _ANCHORS[item.horizontal]
        if anchor:
            common_attributes += f" text-anchor='{anchor}'"
        if item.bold:
            common_attributes += " font-weight='bold'"
        is_on_paper = item.background is None and self._is_on_paper(item)
        if item.background is not None:
            halo = f" stroke='{item.background}' stroke-width='{round(_HALO * _POINT)}' paint-order='stroke'"
            common_attributes += halo
        for number, line in enumerate(lines):
            across = (below + _LINE_STEP * number) * size
            place = f" x='{round(x)}' y='{round(y + across)}'"
            if item.rotation:
                place = f" transform='translate({round(x + across)} {round(y)})rotate(-90)'"
            text = _escape(line)
            if text.strip():
                self.elements.append(_Element("text", place + common_attributes, item.clip, is_on_paper, body=text))


def _write_element(element: _Element, shared_paths: Mapping[str, str]) -> str:
    if element.tag == "text":
        return f"<text{element.attributes}>{element.body}</text>"
    if element.path in shared_paths:
        return f"<use href='#{shared_paths[element.path]}'{element.attributes}/>"
    path = f" d='{element.path}'" if element.path else ""
    return f"<{element.tag}{element.attributes}{path}/>"


def _write_style(body: str) -> str:
    """Return the style for dark pages, with a rule for each colour in use. Paper is white."""
    rules = [f".page{{fill:{_DARK_PAPER}}}"]
    for light, dark in _DARK_COLOURS.items():
        rules += [
            f".ink [{name}='{light}']{{{name}:{dark}}}" for name in ("fill", "stroke") if f"{name}='{light}'" in body
        ]
    return f"<style>@media screen and (prefers-color-scheme:dark){{{''.join(rules)}}}</style>"


def _write_hatch() -> str:
    step = _HATCH_STEP
    lines = f"M0 {step}L{step} 0M-9 9L9 -9M{step - 9} {step + 9}L{step + 9} {step - 9}"
    return (
        f"<pattern id='hatch' width='{step}' height='{step}' patternUnits='userSpaceOnUse'>"
        f"<path stroke='{INK}' stroke-width='{_HATCH_WIDTH}' d='{lines}'/></pattern>"
    )


def _write_stroke(stroke: Stroke, join: str = "") -> str:
    attributes = f" stroke='{stroke.colour}' stroke-width='{round(stroke.width * _POINT)}'"
    if stroke.dashes:
        dashes = " ".join(str(round(dash * _POINT)) for dash in stroke.dashes)
        attributes += f" stroke-dasharray='{dashes}' stroke-linecap='butt'"
    if stroke.opacity < 1:
        attributes += f" stroke-opacity='{stroke.opacity:g}'"
    return attributes + (f" stroke-linejoin='{join}'" if join else "")


def _encode_picture(image: Image.Image) -> str:
    """Return the picture as a data URI: a PNG, or WebP for the many colours of a photograph."""
    if image.getcolors(_MAX_FLAT_COLOURS) is None:
        stream = io.BytesIO()
        image.save(stream, "WEBP", quality=_PHOTOGRAPH_QUALITY, method=2)
        kind, data = "webp", stream.getvalue()
    else:
        kind, data = "png", encode_png(image)
    return f"data:image/{kind};base64,{base64.b64encode(data).decode('ascii')}"


def _cut_picture(item: Picture) -> tuple[Rectangle, NDArray[np.uint8]]:
    """Return the visible pixels, and the place of exactly these."""
    place, visible = item.place, item.place.cut(item.clip)
    rows, columns = item.pixels.shape[:2]
    x_size, y_size = place.width / columns, place.height / rows
    slack = 1e-6
    left = max(0, math.floor((visible.left - place.left) / x_size + slack))
    right = min(columns, math.ceil((visible.left + visible.width - place.left) / x_size - slack))
    place_top = place.bottom + place.height
    top = max(0, math.floor((place_top - visible.bottom - visible.height) / y_size + slack))
    bottom = min(rows, math.ceil((place_top - visible.bottom) / y_size - slack))
    cut_place = Rectangle(
        place.left + left * x_size, place_top - bottom * y_size, (right - left) * x_size, (bottom - top) * y_size
    )
    return cut_place, item.pixels[top:bottom, left:right] if right > left and bottom > top else item.pixels[:0, :0]


def _find_ground(item: Area) -> Rectangle | None:
    """Return the part of the page that an opaque upright rectangle covers; None for other areas."""
    if item.fill is None or item.opacity < 1 or len(item.points) != 4:
        return None
    (left, bottom), (right, top) = item.points.min(axis=0), item.points.max(axis=0)
    is_upright = all(x in (left, right) and y in (bottom, top) for x, y in item.points)
    if not is_upright:
        return None
    return Rectangle(float(left), float(bottom), float(right - left), float(top - bottom)).cut(item.clip)


def _measure_extent(item: Item) -> Rectangle:
    """Return the smallest rectangle around an item's visible points; its place for a text."""
    match item:
        case Picture():
            return item.place.cut(item.clip)
        case Words():
            return Rectangle(item.x, item.y, 0, 0)
        case _:
            points = item.points.reshape(-1, 2)
            points = points[np.isfinite(points).all(axis=1)]
            if not len(points):
                return Rectangle(0, 0, 0, 0)
            (left, bottom), (right, top) = points.min(axis=0), points.max(axis=0)
            extent = Rectangle(float(left), float(bottom), float(right - left), float(top - bottom))
            return extent.cut(item.clip)


def _to_units(inches: float) -> int:
    return round(inches * UNITS)


def _escape(text: str) -> str:
    """Return the text for an element, without characters that are invisible or that XML does not allow."""
    characters: Sequence[str] = [
        character if character.isprintable() or character in _JOINERS else " " if character.isspace() else ""
        for character in text
    ]
    return escape("".join(characters), quote=False)
