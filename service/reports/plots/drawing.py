"""A drawing as a list of lines, areas, marks, images and texts, in inches from its lower left corner.

``panel.py`` draws data with axes on it. ``raster.py`` turns it into pixels, and ``svg.py`` into an SVG document. Later
items cover earlier ones.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from typing import Literal, TypedDict, Unpack

import numpy as np
from matplotlib.markers import MarkerStyle
from numpy.typing import NDArray

from service.reports.plots.style import INK, MIN_FONT_SIZE, TITLE_LEFT, WIDTH, lay_out_title

#: Default size of text, in points.
TEXT_SIZE = 8.5

Points = NDArray[np.float64]
Horizontal = Literal["left", "center", "right"]
#: ``middle`` is the middle of capitals and digits, ``center`` that of the whole line.
Vertical = Literal["baseline", "top", "center", "middle", "bottom"]
_SLACK = 1e-6  # inches


@dataclass(frozen=True, slots=True)
class Rectangle:
    """A rectangle, inches."""

    left: float
    bottom: float
    width: float
    height: float

    @property
    def corners(self) -> Points:
        """The four corners, counter-clockwise from the lower left one."""
        right, top = self.left + self.width, self.bottom + self.height
        return np.array([(self.left, self.bottom), (right, self.bottom), (right, top), (self.left, top)])

    def cut(self, clip: Rectangle | None) -> Rectangle:
        """Return the part inside ``clip``, which can be empty; all of it without one."""
        if clip is None:
            return self
        left, bottom = max(self.left, clip.left), max(self.bottom, clip.bottom)
        right = min(self.left + self.width, clip.left + clip.width)
        top = min(self.bottom + self.height, clip.bottom + clip.height)
        return Rectangle(left, bottom, max(0.0, right - left), max(0.0, top - bottom))

    def contains(self, other: Rectangle) -> bool:
        """Return whether ``other`` is inside, apart from rounding."""
        return (
            other.left >= self.left - _SLACK
            and other.bottom >= self.bottom - _SLACK
            and other.left + other.width <= self.left + self.width + _SLACK
            and other.bottom + other.height <= self.bottom + self.height + _SLACK
        )


@dataclass(frozen=True, slots=True)
class Stroke:
    """The style of a line: width and dashes in points, opacity from 0 to 1."""

    colour: str
    width: float
    dashes: tuple[float, ...] = ()
    opacity: float = 1.0


@dataclass(frozen=True, slots=True)
class Line:
    """A line through points, shape (n, 2)."""

    points: Points
    stroke: Stroke
    clip: Rectangle | None = None


@dataclass(frozen=True, slots=True)
class Segments:
    """Separate straight lines of one style, shape (n, 2, 2): n pairs of points."""

    points: Points
    stroke: Stroke
    clip: Rectangle | None = None


@dataclass(frozen=True, slots=True)
class Area:
    """A closed polygon, shape (n, 2), with a fill, an edge, or both."""

    points: Points
    fill: str | None = None
    edge: Stroke | None = None
    opacity: float = 1.0  # of the fill
    hatched: bool = False
    clip: Rectangle | None = None


@dataclass(frozen=True, slots=True)
class Marks:
    """One marker at each of several points, shape (n, 2). ``size`` is in points."""

    points: Points
    marker: MarkerStyle
    size: float
    fill: str | None
    edge: Stroke | None = None
    clip: Rectangle | None = None


@dataclass(frozen=True, slots=True)
class Picture:
    """An RGB image, shape (rows, columns, 3), whose pixels fill a rectangle, the first row at the top."""

    pixels: NDArray[np.uint8]
    place: Rectangle
    clip: Rectangle | None = None


@dataclass(frozen=True, slots=True)
class Words:
    """Text of one or more lines. ``x`` and ``y`` are the place of its anchor, ``rotation`` is 0 or 90 degrees."""

    text: str
    x: float
    y: float
    size: float  # points
    colour: str = INK
    bold: bool = False
    horizontal: Horizontal = "left"
    vertical: Vertical = "baseline"
    rotation: Literal[0, 90] = 0
    background: str | None = None  # of a box behind the text
    clip: Rectangle | None = None


class TextStyle(TypedDict, total=False):
    """Options of a text with the defaults of ``Words``."""

    colour: str
    bold: bool
    horizontal: Horizontal
    vertical: Vertical
    rotation: Literal[0, 90]
    background: str | None


Item = Line | Segments | Area | Marks | Picture | Words


@dataclass(slots=True)
class Drawing:
    """A white page of ``width`` x ``height`` inches and the items on it, in the order of drawing."""

    width: float
    height: float
    items: list[Item] = field(default_factory=list)

    @property
    def texts(self) -> list[str]:
        """The texts on the drawing, in order."""
        return [item.text for item in self.items if isinstance(item, Words)]

    def add_text(
        self,
        x: float,
        y: float,
        text: str,
        *,
        size: float = TEXT_SIZE,
        clip: Rectangle | None = None,
        **style: Unpack[TextStyle],
    ) -> None:
        """Add text, in a size that a phone can show."""
        self.items.append(Words(text, x, y, max(size, MIN_FONT_SIZE), clip=clip, **style))

    def add_line(self, points: Iterable[Sequence[float]], stroke: Stroke) -> None:
        """Add a line through points."""
        self.items.append(Line(np.array(list(points)), stroke))

    def add_marks(
        self, points: Iterable[Sequence[float]], marker: MarkerStyle, size: float, fill: str | None, edge: Stroke | None
    ) -> None:
        """Add a marker at each of the points."""
        self.items.append(Marks(np.array(list(points)), marker, size, fill, edge))

    def add_rectangle(
        self, place: Rectangle, *, fill: str | None = None, edge: Stroke | None = None, hatched: bool = False
    ) -> None:
        """Add a rectangle."""
        self.items.append(Area(place.corners, fill, edge, hatched=hatched))


def create_drawing(height: float, title: str, subtitle: str = "") -> Drawing:
    """Return a page with its title and subtitle at the top left, in ``HEAD`` inches."""
    drawing = Drawing(WIDTH, height)
    for line in lay_out_title(WIDTH, height, title, subtitle):
        drawing.add_text(
            TITLE_LEFT, line.top, line.text, size=line.size, colour=line.colour, bold=line.bold, vertical="top"
        )
    return drawing
