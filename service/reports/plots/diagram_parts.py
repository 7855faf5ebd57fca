"""Parts of block and sequence diagrams: the page, actors, arrows, labels, and highlights of differences.

``block_drawing.py`` and ``sequence_drawing.py`` decide the positions.
"""

from __future__ import annotations

import math
import textwrap
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import is_color_like, to_rgb
from matplotlib.figure import Figure
from matplotlib.font_manager import FontProperties
from matplotlib.patches import Ellipse, FancyArrowPatch, FancyBboxPatch, Patch, PathPatch, Polygon, Rectangle
from matplotlib.path import Path
from matplotlib.text import Text

from service.reports.display_text import to_one_line
from service.reports.plots.plot import DPI
from service.reports.plots.style import (
    BOLD_FONT_FILE,
    FAINT,
    FAULT,
    FONT_FILE,
    INK,
    LEFT,
    MAX_PIXELS,
    MIN_FONT_SIZE,
    RIGHT,
    RULE,
    TITLE_LEFT,
    WIDTH,
    lay_out_title,
    replace_missing_glyphs,
)
from submissions.diagram import DiagramActor, DiagramArrow

#: Characters of 8 point type in an inch.
CHARACTERS = 14.9
#: The height of a label's line, in inches.
LINE_HEIGHT = 0.131
_FILL = "#eef1f4"
_DASHES: dict[str, Any] = {"solid": "solid", "dashed": (0, (3.2, 1.8)), "dotted": (0, (1.2, 1.6))}
_HEADS = {"target": "-|>", "both": "<|-|>", "none": "-"}
_HALF_TURN = np.linspace(0, np.pi, 24)
_ROUND = ("roundedbox", "flowchart.terminator", "actor", "mail")
_OVAL = ("ellipse", "circle", "cloud", "beginpoint", "endpoint")
_DIAMOND = ("diamond", "minidiamond", "flowchart.condition")
_BARE = ("none", "dots", "textbox")


@dataclass(frozen=True, slots=True)
class Highlights:
    """The actors and arrows (source, target) to highlight as different, and the style; none by default."""

    actors: frozenset[str] = frozenset()
    arrows: frozenset[tuple[str, str]] = frozenset()
    colour: str = FAULT
    sign: str = "✗"
    words: str = ""

    def is_highlighted(self, arrow: DiagramArrow) -> bool:
        """Return whether an arrow is highlighted, itself or through one of its ends."""
        pair = (arrow.source, arrow.target)
        is_reverse_highlighted = arrow.heads != "target" and pair[::-1] in self.arrows
        return pair in self.arrows or is_reverse_highlighted or not self.actors.isdisjoint(pair)

    def add_sign(self, arrow: DiagramArrow, lines: tuple[str, ...]) -> tuple[str, ...]:
        """Return the label of an arrow with the sign before it, for readers who don't distinguish the colours."""
        return (
            (f"{self.sign} {lines[0] if lines else ''}".rstrip(), *lines[1:]) if self.is_highlighted(arrow) else lines
        )

    def draw_explanation(self, figure: Figure) -> None:
        """Write the meaning of the sign at the foot of the figure, if the sign is used."""
        if self.actors or self.arrows:
            write_text(figure, 0.08, 0.07, f"{self.sign} {self.words}", size=7.8, colour=self.colour, bold=True)


def create_figure(height: float, title: str, subtitle: str = "", width: float = WIDTH) -> Figure:
    """Return a white figure of ``width`` x ``height`` inches with its title at the top left, in ``HEAD`` inches.

    Very large figures get a lower resolution to save memory.
    """
    dpi = min(DPI, math.sqrt(MAX_PIXELS / (width * height)))
    figure = Figure(figsize=(width, height), dpi=dpi, facecolor="white")
    for line in lay_out_title(width, height, title, subtitle):
        write_text(
            figure, TITLE_LEFT, line.top, line.text, size=line.size, colour=line.colour, bold=line.bold, va="top"
        )
    return figure


def write_text(
    figure: Figure,
    x: float,
    y: float,
    text: str,
    *,
    size: float = 8.5,
    colour: str = INK,
    bold: bool = False,
    va: str = "baseline",
) -> Text:
    """Write text at ``x``, ``y`` inches from the lower left corner of the figure."""
    width, height = figure.get_size_inches()
    return figure.text(
        x / width, y / height, replace_missing_glyphs(text), color=colour, ha="left", va=va, font=load_font(size,
        bold=bold),
        parse_math=False,
    )  # fmt: skip


def add_axes(figure: Figure, left: float, bottom: float, width: float, height: float) -> Axes:
    """Return axes without ticks and frame at a rectangle. Their coordinates are inches from its lower left corner."""
    figure_width, figure_height = figure.get_size_inches()
    axes = figure.add_axes((left / figure_width, bottom / figure_height, width / figure_width, height / figure_height))
    axes.set_axis_off()
    axes.set_xlim(0, width)
    axes.set_ylim(0, height)
    return axes


@lru_cache(maxsize=64)
def load_font(size: float, *, bold: bool = False) -> FontProperties:
    """Return the type bundled with matplotlib, independent of installed fonts, in a size readable on a phone."""
    return FontProperties(fname=str(BOLD_FONT_FILE if bold else FONT_FILE), size=max(size, MIN_FONT_SIZE))


def break_label(text: str, inches: float, max_lines: int) -> tuple[str, ...]:
    """Break a label into lines of at most this width. Its own line breaks stay."""
    width = max(4, int(inches * CHARACTERS))
    source_lines = [to_one_line(line, 200) for line in text.split("\n")[: max_lines + 1]]
    lines = [piece for line in source_lines for piece in textwrap.wrap(line, width) or [""]]
    while lines and not lines[-1]:
        lines.pop()
    if len(lines) > max_lines:
        lines = [*lines[: max_lines - 1], lines[max_lines - 1][: width - 1] + "…"]
    return tuple(lines)


def draw_label(axes: Axes, x: float, y: float, lines: tuple[str, ...], colour: str, va: str = "bottom") -> None:
    """Draw the lines of a label, centred over ``x``, on white."""
    if any(lines):
        axes.text(
            x, y, replace_missing_glyphs("\n".join(lines)), font=load_font(8), color=colour, ha="center", va=va,
            parse_math=False,
            linespacing=1.05, zorder=2.5, bbox={"facecolor": "white", "edgecolor": "none", "pad": 0.4},
        )  # fmt: skip


def draw_actor(
    axes: Axes,
    actor: DiagramActor,
    x: float,
    y: float,
    width: float,
    height: float,
    lines: tuple[str, ...],
    highlights: Highlights,
) -> Patch:
    """Draw an actor centred at ``x``, ``y``, and return the patch where arrows end."""
    is_different = actor.name in highlights.actors
    fill = _choose_colour(actor.colour, _FILL)
    patch = _create_shape(actor.shape, x, y, width, height)
    patch.set(
        facecolor="white" if actor.shape in _BARE else fill,
        edgecolor=highlights.colour if is_different else "white" if actor.shape in _BARE else FAINT,
        linewidth=1.8 if is_different else 0.8,
        linestyle=_DASHES["dashed"] if is_different else _DASHES[actor.line],
        zorder=3,
    )
    axes.add_patch(patch)
    ink = _choose_colour(actor.text_colour, INK if actor.shape in _BARE or _is_light(fill) else "white")
    axes.text(
        x, y, replace_missing_glyphs("\n".join(lines)), font=load_font(7.8, bold=True), color=ink, ha="center",
        va="center" if len(lines) > 1 else "center_baseline", parse_math=False, linespacing=1.05, zorder=5,
    )  # fmt: skip
    if is_different:
        axes.text(
            x + width / 2, y + height / 2, highlights.sign, font=load_font(8.5, bold=True), color=highlights.colour,
            ha="center", va="center", zorder=6,
            bbox={"boxstyle": "circle,pad=0.12", "facecolor": "white", "edgecolor": highlights.colour},
        )  # fmt: skip
    return patch


def choose_arrow_colour(arrow: DiagramArrow, highlights: Highlights) -> str:
    """Return the colour of an arrow: by highlight, by its text, or by its sender."""
    if highlights.is_highlighted(arrow):
        return highlights.colour
    if arrow.failed:
        return FAULT
    default_colour = {("robot", "responder"): LEFT, ("responder", "robot"): RIGHT}.get(
        (arrow.source, arrow.target), INK
    )
    return _choose_colour(arrow.colour, default_colour)


def draw_arrow(
    axes: Axes,
    arrow: DiagramArrow,
    start: tuple[float, float],
    end: tuple[float, float],
    highlights: Highlights,
    ends: tuple[Patch | None, Patch | None] = (None, None),
    bend: float = 0.0,
) -> None:
    """Draw the line of an arrow with its heads, clipped at the patches that it connects."""
    styles = {"target": "->", "both": "<->", "none": "-"} if arrow.open_head else _HEADS
    style = "-" if arrow.failed else styles[arrow.heads]
    line = "dotted" if arrow.failed else arrow.line
    if line == "solid" or arrow.open_head or style == "-":
        strokes = [(style, _DASHES[line], 1.9 if highlights.is_highlighted(arrow) else 1.2)]
    else:  # otherwise the heads would be dashed too
        strokes = [("-", _DASHES[line], 1.2), (style, "solid", 0.0)]
    for arrow_style, dashes, line_width in strokes:
        size = "head_length=4.6,head_width=2.6" if line_width else "head_length=6.2,head_width=3.4"
        sized_style = arrow_style if arrow_style == "-" else f"{arrow_style},{size}"
        axes.add_patch(
            FancyArrowPatch(
                start, end, arrowstyle=sized_style, connectionstyle=f"arc3,rad={bend}", patchA=ends[0], patchB=ends[1],
                shrinkA=0, shrinkB=0, mutation_scale=1, color=choose_arrow_colour(arrow, highlights),
                linewidth=line_width,
                linestyle=dashes, joinstyle="miter", zorder=2,
            )
        )  # fmt: skip


def draw_group_frame(axes: Axes, x: float, y: float, width: float, height: float, colour: str, text: str) -> None:
    """Draw a group's frame, with its lower left corner at ``x``, ``y`` and its label inside at the top."""
    fill = _choose_colour(colour, "#dbe6f0")
    axes.add_patch(
        FancyBboxPatch((x, y), width, height, boxstyle="round,pad=0,rounding_size=0.08", facecolor=fill, alpha=0.45,
                       edgecolor=RULE, linewidth=0.8, zorder=0)
    )  # fmt: skip
    axes.text(
        x + width / 2, y + height - 0.04, replace_missing_glyphs(to_one_line(text, 40)), font=load_font(7.6), color=INK,
        ha="center", va="top", parse_math=False, zorder=1,
    )  # fmt: skip


def _create_shape(shape: str, x: float, y: float, width: float, height: float) -> Patch:
    left, low = x - width / 2, y - height / 2
    if shape in _ROUND:
        return FancyBboxPatch((left, low), width, height, boxstyle=f"round,pad=0,rounding_size={min(0.16, height / 2)}")
    if shape in _OVAL:
        return Ellipse((x, y), width, height)
    if shape in _DIAMOND:
        return Polygon([(left, y), (x, low), (left + width, y), (x, low + height)])
    if shape == "flowchart.input":
        slant = height / 4
        return Polygon(
            [(left, low), (left + width - slant, low), (left + width, low + height), (left + slant, low + height)]
        )
    if shape == "note":
        fold = height / 4
        right, top = left + width, low + height
        return Polygon([(left, low), (right, low), (right, top - fold), (right - fold, top), (left, top)])
    if shape == "flowchart.database":
        return _create_cylinder(left, low, width, height)
    return Rectangle((left, low), width, height)


def _create_cylinder(left: float, low: float, width: float, height: float) -> Patch:
    """Return a cylinder: its body, and its lid as a separate open line."""
    x, y = left + width / 2 * (1 + np.cos(_HALF_TURN)), height / 11 * np.sin(_HALF_TURN)
    bottom, top = low + height / 11, low + height * 10 / 11
    body_points = [*zip(x, top + y, strict=True), *zip(x[::-1], bottom - y, strict=True), (x[0], top)]
    lid = list(zip(x[::-1], top - y, strict=True))  # in the direction of the body, otherwise it would be a hole
    codes = [Path.MOVETO, *[Path.LINETO] * (len(body_points) - 1), Path.MOVETO, *[Path.LINETO] * (len(lid) - 1)]
    return PathPatch(Path([*body_points, *lid], codes))


def _choose_colour(colour: str, default: str) -> str:
    return colour if colour and is_color_like(colour.lower()) else default


def _is_light(colour: str) -> bool:
    red, green, blue = to_rgb(colour.lower())
    return 0.299 * red + 0.587 * green + 0.114 * blue > 0.55
