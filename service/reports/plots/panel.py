"""A rectangle of a drawing with coordinates of its own: data, axes with ticks, grid and frame.

Positions of ticks come from Matplotlib's locators.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Literal, Unpack

import numpy as np
from matplotlib.markers import MarkerStyle
from matplotlib.ticker import MaxNLocator
from numpy.typing import NDArray

from service.reports.plots.drawing import (
    TEXT_SIZE,
    Area,
    Drawing,
    Line,
    Marks,
    Picture,
    Points,
    Rectangle,
    Segments,
    Stroke,
    TextStyle,
)
from service.reports.plots.style import MIN_FONT_SIZE, RULE

_TICK_LENGTH, _TICK_GAP = 3 / 72, 2 / 72  # inches
_LINE_HEIGHT, _DIGIT_WIDTH = MIN_FONT_SIZE / 72 + 0.03, 0.6 * MIN_FONT_SIZE / 72  # inches
_FRAME = Stroke(RULE, 0.8)
_TICK_STEPS = (1, 2, 2.5, 5, 10)
_MAX_TICKS = 9
_LONGEST_NUMBER = 1e7  # larger ones are written with a power of ten

Side = Literal["left", "bottom", "right", "top"]


@dataclass(frozen=True, slots=True)
class Panel:
    """The part ``place`` of a drawing, whose edges have the coordinates ``x_limits`` and ``y_limits``."""

    drawing: Drawing
    place: Rectangle
    x_limits: tuple[float, float]
    y_limits: tuple[float, float]

    def to_inches(self, points: Iterable[Sequence[float]] | Points) -> Points:
        """Return the points, shape (n, 2), as inches on the drawing."""
        place = self.place
        origin = np.array((self.x_limits[0], self.y_limits[0]))
        size = np.array((self.x_limits[1], self.y_limits[1])) - origin
        data = np.asarray(points if isinstance(points, np.ndarray) else list(points), dtype=np.float64)
        scale = np.array((place.width, place.height)) / size
        return np.asarray((data.reshape(-1, 2) - origin) * scale + (place.left, place.bottom))

    def add_line(self, points: Iterable[Sequence[float]] | Points, stroke: Stroke) -> None:
        """Add a line, cut at the panel's edges."""
        self.drawing.items.append(Line(self.to_inches(points), stroke, self.place))

    def add_area(
        self,
        points: Iterable[Sequence[float]] | Points,
        *,
        fill: str | None = None,
        edge: Stroke | None = None,
        opacity: float = 1.0,
        hatched: bool = False,
    ) -> None:
        """Add a polygon, cut at the panel's edges."""
        self.drawing.items.append(Area(self.to_inches(points), fill, edge, opacity, hatched, self.place))

    def add_rectangle(
        self,
        corner: tuple[float, float],
        width: float,
        height: float,
        *,
        fill: str | None = None,
        edge: Stroke | None = None,
        hatched: bool = False,
    ) -> None:
        """Add a rectangle from its corner with the lowest coordinates."""
        self.add_area(Rectangle(*corner, width, height).corners, fill=fill, edge=edge, hatched=hatched)

    def add_marks(
        self,
        points: Iterable[Sequence[float]] | Points,
        marker: MarkerStyle,
        size: float,
        *,
        fill: str | None = None,
        edge: Stroke | None = None,
        clipped: bool = True,
    ) -> None:
        """Add a marker at each of the points."""
        clip = self.place if clipped else None
        self.drawing.items.append(Marks(self.to_inches(points), marker, size, fill, edge, clip))

    def add_picture(self, pixels: NDArray[np.uint8], left: float, bottom: float, right: float, top: float) -> None:
        """Add an RGB image between the coordinates, cut at the panel's edges."""
        (x0, y0), (x1, y1) = self.to_inches([(left, bottom), (right, top)])
        place = Rectangle(min(x0, x1), min(y0, y1), abs(x1 - x0), abs(y1 - y0))
        self.drawing.items.append(Picture(pixels, place, self.place))

    def add_text(
        self,
        x: float,
        y: float,
        text: str,
        *,
        size: float = TEXT_SIZE,
        clipped: bool = False,
        **style: Unpack[TextStyle],
    ) -> None:
        """Add text like ``Drawing.add_text``, at a point of the panel."""
        ((left, bottom),) = self.to_inches([(x, y)])
        clip = self.place if clipped else None
        self.drawing.add_text(float(left), float(bottom), text, size=size, clip=clip, **style)

    def fill(self, colour: str) -> None:
        """Colour the panel."""
        self.drawing.add_rectangle(self.place, fill=colour)

    def add_frame(self, sides: Sequence[Side] = ("left", "bottom", "right", "top")) -> None:
        """Draw edges of the panel."""
        low_left, low_right, top_right, top_left = self.place.corners
        edges: Mapping[Side, tuple[Points, Points]] = {
            "left": (low_left, top_left),
            "bottom": (low_left, low_right),
            "right": (low_right, top_right),
            "top": (top_left, top_right),
        }
        self._add_segments([edges[side] for side in sides], _FRAME)

    def add_x_axis(
        self, ticks: Sequence[float] | None = None, *, label: str = "", are_ticks_labelled: bool = True
    ) -> None:
        """Draw ticks below the panel, at round numbers if ``ticks`` is None, and the name of the axis."""
        ticks = self.choose_x_ticks() if ticks is None else ticks
        bottom = self.place.bottom
        xs = self._to_x_inches(ticks)
        self._add_segments([((x, bottom), (x, bottom - _TICK_LENGTH)) for x in xs], _FRAME)
        y = bottom - _TICK_LENGTH - _TICK_GAP
        for x, text in zip(xs, format_ticks(ticks) if are_ticks_labelled else (), strict=False):
            self.drawing.add_text(x, y, text, size=MIN_FONT_SIZE, horizontal="center", vertical="top")
        if label:
            middle = self.place.left + self.place.width / 2
            self.drawing.add_text(middle, y - _LINE_HEIGHT, label, horizontal="center", vertical="top")

    def add_y_axis(
        self,
        ticks: Sequence[float] | None = None,
        labels: Sequence[str] | None = None,
        *,
        label: str = "",
        tick_length: float = _TICK_LENGTH,
    ) -> None:
        """Draw ticks at the left of the panel, at round numbers if ``ticks`` is None, and the name of the axis."""
        ticks = self.choose_y_ticks() if ticks is None else ticks
        labels = format_ticks(ticks) if labels is None else labels
        left = self.place.left
        ys = self._to_y_inches(ticks)
        self._add_segments([((left, y), (left - tick_length, y)) for y in ys], _FRAME)
        x = left - tick_length - _TICK_GAP
        for y, text in zip(ys, labels, strict=True):
            self.drawing.add_text(x, y, text, size=MIN_FONT_SIZE, horizontal="right", vertical="middle")
        if label:
            widest = max((len(text) for text in labels), default=0) * _DIGIT_WIDTH
            middle = self.place.bottom + self.place.height / 2
            self.drawing.add_text(max(x - widest - 0.03, 0.14), middle, label, horizontal="center", rotation=90)

    def choose_x_ticks(self) -> list[float]:
        """Return round numbers along the x axis, as many as fit."""
        return choose_ticks(self.x_limits, int(self.place.width * 72 / (MIN_FONT_SIZE * 3)))

    def choose_y_ticks(self, max_intervals: int | None = None) -> list[float]:
        """Return round numbers along the y axis, as many as fit or as limited."""
        return choose_ticks(self.y_limits, max_intervals or int(self.place.height * 72 / (MIN_FONT_SIZE * 2)))

    def add_grid(self, x_ticks: Sequence[float], y_ticks: Sequence[float], opacity: float = 0.7) -> None:
        """Draw thin lines through the ticks of both axes."""
        place = self.place
        right, top = place.left + place.width, place.bottom + place.height
        lines = [
            *(((x, place.bottom), (x, top)) for x in self._to_x_inches(x_ticks)),
            *(((place.left, y), (right, y)) for y in self._to_y_inches(y_ticks)),
        ]
        self._add_segments(lines, Stroke(RULE, 0.5, opacity=opacity))

    def _to_x_inches(self, xs: Sequence[float]) -> list[float]:
        return [float(x) for x in self.to_inches([(x, self.y_limits[0]) for x in xs])[:, 0]]

    def _to_y_inches(self, ys: Sequence[float]) -> list[float]:
        return [float(y) for y in self.to_inches([(self.x_limits[0], y) for y in ys])[:, 1]]

    def _add_segments(self, segments: Sequence[tuple[Sequence[float] | Points, ...]], stroke: Stroke) -> None:
        if segments:
            self.drawing.items.append(Segments(np.array(segments, dtype=np.float64), stroke))


def choose_ticks(limits: tuple[float, float], max_intervals: int) -> list[float]:
    """Return round numbers within ascending or descending ``limits``."""
    low, high = sorted(limits)
    intervals = min(max(max_intervals, 1), _MAX_TICKS)
    ticks = MaxNLocator(intervals, steps=_TICK_STEPS).tick_values(low, high)
    slack = 1e-9 * (high - low)
    return [float(tick) for tick in ticks if low - slack <= tick <= high + slack]


def format_ticks(ticks: Sequence[float]) -> list[str]:
    """Return the numbers with the fewest digits that tell them apart."""
    step = min((abs(b - a) for a, b in pairwise(ticks)), default=0.0)
    decimals = next((count for count in range(6) if math.isclose(round(step, count), step, rel_tol=1e-6)), None)
    if step > 0 and decimals is not None and max(map(abs, ticks)) < _LONGEST_NUMBER:
        labels = [f"{tick:.{decimals}f}" for tick in ticks]
    else:
        digits = (count for count in range(3, 17) if len({f"{tick:.{count}g}" for tick in ticks}) == len(set(ticks)))
        digit_count = next(digits, 17)
        labels = [f"{tick:.{digit_count}g}" for tick in ticks]
    return [label.replace("-", "\N{MINUS SIGN}") for label in labels]
