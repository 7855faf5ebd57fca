"""Drawing of sensor readings over time, with what the robot said and sent above.

It shows the recorded readings of every tick, even if the program did not read them.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from numpy.typing import NDArray

from service.grading.grade import TrialResult
from service.reports.plots.style import (
    FAINT,
    FAULT,
    HEAD,
    INK,
    LEFT,
    RIGHT,
    RULE,
    SAID,
    SECOND_ROBOT,
    WIDTH,
    add_axes,
    create_figure,
    load_font,
    set_tick_size,
    write_text,
)  # fmt: skip
from sim.columns import Panel
from sim.recording import COLUMNS, TICK, Recording
from sim.recording_values import tick_to_seconds

_LEFT_EDGE, _RIGHT_EDGE = 0.56, 0.12  # inches
_GAP = 0.20  # between panels, room for the panel's title
_ROW = 0.15  # height of a strip of events
_MAX_MARKS = 400  # of one kind; more would form a solid bar
_MAX_READING = 1e100  # a program can set motor positions that are too large to draw


@dataclass(frozen=True, slots=True)
class ReadingCurve:
    """One reading over time. The second of a panel is dashed."""

    label: str
    values: NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class ReadingPanel:
    """Curves with the same unit."""

    panel: Panel
    curves: tuple[ReadingCurve, ...]


@dataclass(frozen=True, slots=True)
class Strip:
    """Moments of one kind, drawn as marks on a separate line."""

    label: str
    times: tuple[float, ...]
    marker: str
    colour: str


def draw_sensors(trial: TrialResult, title: str) -> Figure:
    """Draw reflected light (mean red, 0..255), distance (cm), gyro and wheel encoders (degrees) of ``trial``."""
    recording = trial.recording
    panels, strips = build_panels(recording), build_strips(recording)
    strip_height = _ROW * len(strips) + 0.10 if strips else 0.0
    body_height = sum(each.panel.height + _GAP for each in panels)
    figure = create_figure(HEAD + strip_height + body_height + 0.36, title, _format_subtitle(trial))
    end = max(recording.end_t, tick_to_seconds(recording, len(recording.ticks)), 0.1)
    top = float(figure.get_size_inches()[1]) - HEAD
    width = WIDTH - _LEFT_EDGE - _RIGHT_EDGE
    if strips:
        top -= strip_height
        _draw_strips(add_axes(figure, _LEFT_EDGE, top, width, strip_height), strips, end)
    for number, panel in enumerate(panels):
        height = panel.panel.height
        top -= height + _GAP
        axes = add_axes(figure, _LEFT_EDGE, top, width, height)
        write_text(figure, _LEFT_EDGE, top + height + 0.045, panel.panel.title, size=8, bold=True)
        _draw_panel(axes, panel, recording.ticks.t, end)
        if len(panel.curves) > 1:
            _label_curves(figure, panel, top + height + 0.045)
        if number < len(panels) - 1:
            axes.tick_params(labelbottom=False)
        else:
            axes.set_xlabel("simulated time, s", font=load_font(8.5), labelpad=1)
    return figure


def build_panels(recording: Recording) -> tuple[ReadingPanel, ...]:
    """Return the panels for ``draw_sensors``, top to bottom."""
    displayed_columns = recording.ticks.to_displayed_columns()
    curves: dict[Panel, list[ReadingCurve]] = {}
    for column in COLUMNS:
        if column.panel is not None:
            values = displayed_columns[column.display_attribute]
            curve_values = values if values.ndim == 1 else values[:, 0]
            curves.setdefault(column.panel, []).append(ReadingCurve(column.label, curve_values / column.panel.per))
    sorted_panels = sorted(curves, key=lambda panel: panel.rank)
    return tuple(ReadingPanel(panel, tuple(curves[panel])) for panel in sorted_panels)


def build_strips(recording: Recording) -> tuple[Strip, ...]:
    """Return the kinds of events that occurred, with their times in seconds."""
    answers = [m for m in recording.messages if m.sender == "responder"]
    partner_messages = [m for m in recording.messages if m.sender == "partner"]
    strips = (
        Strip("sent", tuple(m.t for m in recording.messages if m.sender == "robot"), ">", LEFT),
        Strip("answer", tuple(m.delivered for m in answers if m.delivered is not None), "<", RIGHT),
        Strip("heard", tuple(m.delivered for m in partner_messages if m.delivered is not None), "<", SECOND_ROBOT),
        Strip("said", tuple(line.t for line in recording.spoken), "o", SAID),
        Strip("touch", tuple(touch.t for touch in recording.touches), "D", FAULT),
        Strip("fault", tuple(fault.t for fault in recording.faults), "X", FAULT),
    )
    return tuple(strip for strip in strips if strip.times)


def _format_subtitle(trial: TrialResult) -> str:
    noise = []
    if trial.light_noise:
        noise.append(f"light noise {trial.light_noise:g}")
    if trial.motor_noise:
        noise.append(f"motor noise {trial.motor_noise:g}")
    tick = "1/30 s" if trial.recording.ticks.length == TICK else f"{1000 / trial.recording.ticks.per_second:g} ms"
    return f"trial {trial.index + 1}; {', '.join(noise) or 'no noise'}; one reading every {tick}"


def _draw_strips(axes: Axes, strips: Sequence[Strip], end: float) -> None:
    axes.set_xlim(0, end)
    axes.set_ylim(-0.6, len(strips) - 0.4)
    axes.set_xticks([])
    axes.set_yticks(range(len(strips)), [strip.label for strip in reversed(strips)])
    set_tick_size(axes, 7.5)
    axes.tick_params(axis="y", length=0)
    for row, strip in enumerate(reversed(strips)):
        axes.axhline(row, color=RULE, linewidth=0.6, zorder=0)
        times = strip.times[:_MAX_MARKS]
        axes.plot(times, [row] * len(times), strip.marker, color=strip.colour, markersize=4.5, markeredgewidth=0,
                  clip_on=False)  # fmt: skip
    for side in axes.spines.values():
        side.set_visible(False)


def _draw_panel(axes: Axes, panel: ReadingPanel, times: NDArray[np.float64], end: float) -> None:
    axes.set_xlim(0, end)
    for curve, colour, dashes, width in zip(panel.curves, (LEFT, RIGHT), ((), (3.2, 1.2)), (1.1, 1.3), strict=False):
        axes.plot(times, _clip_readings(curve.values), color=colour, linewidth=width, dashes=dashes or (None, None))
    limits = panel.panel.limits or _compute_limits(panel)
    axes.set_ylim(*limits)
    if panel.panel.marks:
        axes.set_yticks(panel.panel.marks)
    else:
        axes.locator_params(axis="y", nbins=4)
    axes.grid(axis="both", color=RULE, linewidth=0.5, alpha=0.7)
    axes.spines["top"].set_visible(False)
    axes.spines["right"].set_visible(False)
    if not len(times):
        axes.text(0.5, 0.5, "no time passed", transform=axes.transAxes, ha="center", va="center", color=FAINT,
                  font=load_font(8))  # fmt: skip


def _compute_limits(panel: ReadingPanel) -> tuple[float, float]:
    values = _clip_readings(np.concatenate([curve.values for curve in panel.curves]))
    values = values[np.isfinite(values)]
    low, high = (float(values.min()), float(values.max())) if len(values) else (0.0, 0.0)
    # Large numbers need a wider range, in which the ends of the axis still differ.
    least = max(10.0, 1e-6 * max(abs(low), abs(high)))
    if high - low < least:
        low, high = (low + high - least) / 2, (low + high + least) / 2
    margin = 0.08 * (high - low)
    return low - margin, high + margin


def _clip_readings(values: NDArray[np.float64]) -> NDArray[np.float64]:
    return np.clip(values, -_MAX_READING, _MAX_READING)


def _label_curves(figure: Figure, panel: ReadingPanel, y: float) -> None:
    right_edge = WIDTH - _RIGHT_EDGE
    width, height = figure.get_size_inches()
    for curve, text_x, colour in zip(panel.curves, (right_edge - 0.86, right_edge - 0.30), (LEFT, RIGHT), strict=True):
        write_text(figure, text_x, y, curve.label, size=8, colour=INK)
        ends = [(text_x - 0.25) / width, (text_x - 0.05) / width]
        line = Line2D(ends, [(y + 0.045) / height] * 2, color=colour, linewidth=1.5)
        if colour == RIGHT:
            line.set_dashes((2.6, 1.0))
        figure.add_artist(line)
