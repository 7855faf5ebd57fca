"""Drawing of accuracy curves: one panel per condition, one line with its 95 % band per curve.

The caller supplies the fractions, intervals and counts.
"""

from __future__ import annotations

import textwrap
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from matplotlib.markers import MarkerStyle

from service.reports.display_text import to_one_line
from service.reports.plots.drawing import Drawing, Rectangle, Stroke, create_drawing
from service.reports.plots.panel import Panel, choose_ticks
from service.reports.plots.style import FAINT, FAULT, HEAD, LEFT, RIGHT, RULE, SAID, WIDTH


@dataclass(frozen=True, slots=True)
class CurveStyle:
    """Colour, dashes in points and marker of a curve."""

    colour: str
    dashes: tuple[float, ...]
    marker: MarkerStyle


#: The styles of the curves, in order. They differ without colour too.
CURVE_STYLES = (
    CurveStyle(LEFT, (), MarkerStyle("o")),
    CurveStyle(RIGHT, (5.2, 2.2), MarkerStyle("s")),
    CurveStyle(SAID, (1.4, 2.3), MarkerStyle("^")),
    CurveStyle(FAINT, (9.0, 2.2, 1.4, 2.2), MarkerStyle("D")),
)
_LEFT, _RIGHT_MARGIN = 0.62, 0.16
_PANEL, _BELOW, _ABOVE = 1.22, 0.46, 0.36  # inches: the axes, its labels, its title
_FOOT = 0.26
_Y_TICKS, _Y_LABELS = (0, 0.25, 0.5, 0.75, 1), ("0", "0.25", "0.5", "0.75", "1")
_LEGEND_LINE, _CHARACTER_WIDTH = 0.135, 0.066  # inches


@dataclass(frozen=True, slots=True)
class Curve:
    """A fraction at each of ``x``, ascending, with its interval and sample count."""

    label: str  # for the legend; not shown if a panel has one curve
    x: tuple[float, ...]
    share: tuple[float, ...]
    low: tuple[float, ...]
    high: tuple[float, ...]
    n: tuple[int, ...]


@dataclass(frozen=True, slots=True)
class AccuracyPanel:
    """The varied condition and its unit, the curves, and the required accuracy, if there is one."""

    varied: str
    unit: str
    curves: tuple[Curve, ...]
    level: float | None = None


def draw_curves(panels: Sequence[AccuracyPanel], title: str, subtitle: str = "") -> Drawing:
    """Draw the panels below each other, all with an axis from 0 to 1."""
    row = _ABOVE + _PANEL + _BELOW
    height = HEAD + row * len(panels) + _FOOT
    drawing = create_drawing(height, title, subtitle)
    for number, panel in enumerate(panels):
        top = height - HEAD - row * number
        drawing.add_text(0.08, top - 0.14, to_one_line(panel.varied, 40), size=9, bold=True, vertical="center")
        drawing.add_text(
            WIDTH - _RIGHT_MARGIN, top - 0.14, _format_counts(panel.curves), size=8, colour=FAINT,
            horizontal="right", vertical="center",
        )  # fmt: skip
        place = Rectangle(_LEFT, top - _ABOVE - _PANEL, WIDTH - _LEFT - _RIGHT_MARGIN, _PANEL)
        _draw_panel(drawing, place, panel)
    drawing.add_text(0.08, 0.09, "line: accuracy;  band: 95 % interval (Wilson)", size=7.5, colour=FAINT)
    return drawing


def _draw_panel(drawing: Drawing, place: Rectangle, accuracies: AccuracyPanel) -> None:
    """Draw all curves of one panel, with labelled axes and, for several curves, a legend."""
    xs = sorted({x for curve in accuracies.curves for x in curve.x})
    panel = Panel(drawing, place, choose_limits(xs), (-0.04, 1.04))
    panel.add_grid((), _Y_TICKS, opacity=1)
    for number, curve in enumerate(accuracies.curves):
        draw_curve(panel, curve, CURVE_STYLES[number % len(CURVE_STYLES)])
    if accuracies.level is not None:
        _draw_required_level(panel, accuracies.level)
    panel.add_frame()
    x_ticks = _select_ticks(xs) if len(xs) <= 9 else choose_ticks(panel.x_limits, 9)
    panel.add_x_axis(x_ticks, label=f"{to_one_line(accuracies.varied, 40)}, {accuracies.unit}")
    panel.add_y_axis(_Y_TICKS, _Y_LABELS, label="accuracy")
    if len(accuracies.curves) > 1:
        _draw_legend(panel, accuracies.curves)


def choose_limits(xs: Sequence[float]) -> tuple[float, float]:
    """Return limits around ``xs``, with a margin on both sides."""
    low, high = (min(xs), max(xs)) if xs else (0.0, 1.0)
    margin = 0.05 * (high - low) or 0.05
    return low - margin, high + margin


def draw_curve(panel: Panel, curve: Curve, style: CurveStyle = CURVE_STYLES[0]) -> None:
    """Draw one curve: its band, then its line, with a marker at each measured value."""
    if len(curve.x) > 1:
        band = [*zip(curve.x, curve.low, strict=True), *reversed([*zip(curve.x, curve.high, strict=True)])]
        panel.add_area(band, fill=style.colour, opacity=0.18)
        for edge in (curve.low, curve.high):
            panel.add_line(zip(curve.x, edge, strict=True), Stroke(style.colour, 0.6, opacity=0.55))
    else:
        for x, low, high in zip(curve.x, curve.low, curve.high, strict=True):
            panel.add_line([(x, low), (x, high)], Stroke(style.colour, 1.2))
    points = np.column_stack((curve.x, curve.share))
    panel.add_line(points, Stroke(style.colour, 1.4, style.dashes))
    panel.add_marks(points, style.marker, 3.4, fill=style.colour, edge=Stroke(style.colour, 1))


def _draw_required_level(panel: Panel, level: float) -> None:
    left, right = panel.x_limits
    panel.add_line([(left, level), (right, level)], Stroke(FAULT, 0.9, (5.4, 1.8)))
    panel.add_text(
        right - 0.005 * (right - left), level - 0.03, f"required: {level:g}", size=7.5, colour=FAULT,
        horizontal="right", vertical="top",
    )  # fmt: skip


def _draw_legend(panel: Panel, curves: Sequence[Curve]) -> None:
    """Draw the curves' names on a white card, in the corner at the left where the curves leave more room."""
    names = ["\n".join(textwrap.wrap(to_one_line(curve.label, 40), 26)) for curve in curves]
    line_counts = [name.count("\n") + 1 for name in names]
    width = 0.42 + max(len(line) for name in names for line in name.split("\n")) * _CHARACTER_WIDTH
    height = _LEGEND_LINE * sum(line_counts) + 0.06
    place = panel.place
    first_shares = [curve.share[0] for curve in curves if curve.share]
    is_above = sum(first_shares) < 0.5 * len(first_shares)
    bottom = place.bottom + place.height - height - 0.05 if is_above else place.bottom + 0.05
    drawing = panel.drawing
    drawing.add_rectangle(Rectangle(place.left + 0.05, bottom, width, height), fill="white", edge=Stroke(RULE, 0.8))
    y = bottom + height - 0.03
    for number, (name, line_count) in enumerate(zip(names, line_counts, strict=True)):
        style = CURVE_STYLES[number % len(CURVE_STYLES)]
        middle = y - _LEGEND_LINE / 2
        left = place.left + 0.1
        drawing.add_line([(left, middle), (left + 0.26, middle)], Stroke(style.colour, 1.4, style.dashes))
        drawing.add_marks([(left + 0.13, middle)], style.marker, 3.4, style.colour, Stroke(style.colour, 1))
        drawing.add_text(left + 0.32, y - 0.012, name, size=7.5, vertical="top")
        y -= _LEGEND_LINE * line_count


def _format_counts(curves: Sequence[Curve]) -> str:
    counts = {count for curve in curves for count in curve.n}
    if not counts:
        return "n = 0"
    minimum, maximum = min(counts), max(counts)
    return f"n = {minimum if minimum == maximum else f'{minimum} to {maximum}'} images per point"


def _select_ticks(xs: Sequence[float]) -> list[float]:
    """Return the ``xs`` whose labels don't overlap: at least an eighteenth of the width apart."""
    ticks: list[float] = []
    for x in xs:
        if not ticks or x - ticks[-1] >= (xs[-1] - xs[0]) / 18:
            ticks.append(x)
    return ticks
