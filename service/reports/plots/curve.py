"""Drawing of accuracy curves: one panel per condition, one line with its 95 % band per curve.

The caller supplies the fractions, intervals and counts.
"""

from __future__ import annotations

import textwrap
from collections.abc import Sequence
from dataclasses import dataclass

from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import FixedLocator, FuncFormatter, MaxNLocator

from service.reports.display_text import to_one_line
from service.reports.plots.style import (
    FAINT,
    FAULT,
    HEAD,
    INK,
    LEFT,
    RIGHT,
    RULE,
    SAID,
    WIDTH,
    add_axes,
    create_figure,
    load_font,
    replace_missing_glyphs,
    set_tick_size,
    write_text,
)

#: Colour, line and marker of the curves, in order. They differ without colour too.
_STYLES = ((LEFT, "-", "o"), (RIGHT, "--", "s"), (SAID, ":", "^"), (FAINT, "-.", "D"))
_LEFT, _RIGHT_MARGIN = 0.62, 0.16
_PANEL, _BELOW, _ABOVE = 1.22, 0.46, 0.36  # inches: the axes, its labels, its title
_FOOT = 0.26


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


def draw_curves(panels: Sequence[AccuracyPanel], title: str, subtitle: str = "", unit: str = "images") -> Figure:
    """Draw the panels below each other, all with an axis from 0 to 1. ``unit`` is the unit of ``n``."""
    row = _ABOVE + _PANEL + _BELOW
    height = HEAD + row * len(panels) + _FOOT
    figure = create_figure(height, title, subtitle)
    for number, panel in enumerate(panels):
        top = height - HEAD - row * number
        write_text(figure, 0.08, top - 0.14, to_one_line(panel.varied, 40), size=9, bold=True, va="center")
        write_text(figure, WIDTH - _RIGHT_MARGIN, top - 0.14, _format_counts(panel.curves, unit), size=8, ha="right",
              va="center", colour=FAINT)  # fmt: skip
        axes = add_axes(figure, _LEFT, top - _ABOVE - _PANEL, WIDTH - _LEFT - _RIGHT_MARGIN, _PANEL)
        draw_panel(axes, panel)
    write_text(figure, 0.08, 0.09, "line: accuracy;  band: 95 % interval (Wilson)", size=7.5, colour=FAINT)
    return figure


def draw_panel(axes: Axes, panel: AccuracyPanel) -> None:
    """Draw all curves of one panel, with labelled axes and, for several curves, a legend."""
    axes.set_ylim(-0.04, 1.04)
    axes.yaxis.set_major_locator(FixedLocator([0, 0.25, 0.5, 0.75, 1]))
    axes.yaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:.2f}".rstrip("0").rstrip(".")))
    axes.grid(axis="y", color=RULE, linewidth=0.5)
    axes.set_axisbelow(True)
    for curve, style in zip(panel.curves, _cycle_styles(len(panel.curves)), strict=True):
        draw_curve(axes, curve, *style)
    xs = sorted({x for curve in panel.curves for x in curve.x})
    if len(xs) <= 9:
        axes.xaxis.set_major_locator(FixedLocator(_select_ticks(xs)))
    else:
        axes.xaxis.set_major_locator(MaxNLocator(9, steps=[1, 2, 5, 10]))
    axes.xaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}".replace("-", "\N{MINUS SIGN}")))
    axes.set_xlabel(
        replace_missing_glyphs(f"{to_one_line(panel.varied, 40)}, {panel.unit}"),
        font=load_font(8),
        color=INK,
        labelpad=2,
    )
    axes.set_ylabel("accuracy", font=load_font(8), color=INK, labelpad=3)
    set_tick_size(axes)
    if panel.level is not None:
        axes.axhline(panel.level, color=FAULT, linewidth=0.9, linestyle=(0, (6, 2)), zorder=2)
        axes.text(
            0.995, panel.level - 0.03, f"required: {panel.level:g}", transform=axes.get_yaxis_transform(), ha="right",
            va="top", color=FAULT, font=load_font(7.5),
        )  # fmt: skip
    if len(panel.curves) > 1:
        legend = axes.legend(loc="best", prop=load_font(7.5), frameon=True, framealpha=0.85, borderpad=0.3)
        legend.get_frame().set_edgecolor(RULE)


def draw_curve(axes: Axes, curve: Curve, colour: str = LEFT, line: str = "-", marker: str = "o") -> None:
    """Draw one curve: its band, then its line, with a marker at each measured value."""
    if len(curve.x) > 1:
        axes.fill_between(curve.x, curve.low, curve.high, color=colour, alpha=0.18, linewidth=0, zorder=3)
        for edge in (curve.low, curve.high):
            axes.plot(curve.x, edge, color=colour, alpha=0.55, linewidth=0.6, zorder=3)
    else:
        axes.vlines(curve.x, curve.low, curve.high, color=colour, linewidth=1.2, zorder=3)
    axes.plot(
        curve.x, curve.share, color=colour, linestyle=line, marker=marker, markersize=3.4, linewidth=1.4, zorder=4,
        label=replace_missing_glyphs("\n".join(textwrap.wrap(to_one_line(curve.label, 40), 26))),
    )  # fmt: skip


def _format_counts(curves: Sequence[Curve], unit: str) -> str:
    counts = {count for curve in curves for count in curve.n}
    if not counts:
        return "n = 0"
    minimum, maximum = min(counts), max(counts)
    return f"n = {minimum if minimum == maximum else f'{minimum} to {maximum}'} {unit} per point"


def _select_ticks(xs: Sequence[float]) -> list[float]:
    """Return the ``xs`` whose labels don't overlap: at least an eighteenth of the width apart."""
    ticks: list[float] = []
    for x in xs:
        if not ticks or x - ticks[-1] >= (xs[-1] - xs[0]) / 18:
            ticks.append(x)
    return ticks


def _cycle_styles(count: int) -> list[tuple[str, str, str]]:
    return [_STYLES[place % len(_STYLES)] for place in range(count)]
