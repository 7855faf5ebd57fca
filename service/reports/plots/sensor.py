"""Drawing of sensor readings over time, with what the robot said and sent above.

It shows the recorded readings of every tick, even if the program did not read them.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from matplotlib.markers import MarkerStyle
from numpy.typing import NDArray

from service.grading.grade import TrialResult
from service.reports.plots.drawing import Drawing, Rectangle, Stroke, create_drawing
from service.reports.plots.panel import Panel as PlotPanel
from service.reports.plots.style import FAINT, FAULT, HEAD, LEFT, RIGHT, RULE, SAID, SECOND_ROBOT, WIDTH
from sim.columns import Panel
from sim.recording import COLUMNS, TICK, Recording
from sim.recording_values import tick_to_seconds

_LEFT_EDGE, _RIGHT_EDGE = 0.56, 0.12  # inches
_GAP = 0.20  # between panels, room for the panel's title
_ROW = 0.15  # height of a strip of events
_MAX_MARKS = 400  # of one kind; more would form a solid bar
_CURVE_STROKES = (Stroke(LEFT, 1.1), Stroke(RIGHT, 1.3, (4.2, 1.6)))
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


def draw_sensors(trial: TrialResult, title: str) -> Drawing:
    """Draw reflected light (mean red, 0..255), distance (cm), gyro and wheel encoders (degrees) of ``trial``."""
    recording = trial.recording
    panels, strips = build_panels(recording), build_strips(recording)
    strip_height = _ROW * len(strips) + 0.10 if strips else 0.0
    body_height = sum(each.panel.height + _GAP for each in panels)
    drawing = create_drawing(HEAD + strip_height + body_height + 0.36, title, _format_subtitle(trial))
    end = max(recording.end_t, tick_to_seconds(recording, len(recording.ticks)), 0.1)
    top = drawing.height - HEAD
    width = WIDTH - _LEFT_EDGE - _RIGHT_EDGE
    if strips:
        top -= strip_height
        _draw_strips(drawing, Rectangle(_LEFT_EDGE, top, width, strip_height), strips, end)
    for number, panel in enumerate(panels):
        top -= panel.panel.height + _GAP
        place = Rectangle(_LEFT_EDGE, top, width, panel.panel.height)
        _draw_panel(drawing, place, panel, recording.ticks.t, end, is_last=number == len(panels) - 1)
    return drawing


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


def _draw_strips(drawing: Drawing, place: Rectangle, strips: Sequence[Strip], end: float) -> None:
    panel = PlotPanel(drawing, place, (0, end), (-0.6, len(strips) - 0.4))
    labels = [strip.label for strip in reversed(strips)]
    panel.add_y_axis(range(len(strips)), labels, tick_length=0)
    for row, strip in enumerate(reversed(strips)):
        panel.add_line([(0, row), (end, row)], Stroke(RULE, 0.6))
        marks = [(time, row) for time in strip.times[:_MAX_MARKS]]
        panel.add_marks(marks, MarkerStyle(strip.marker), 4.5, fill=strip.colour, clipped=False)


def _draw_panel(
    drawing: Drawing, place: Rectangle, readings: ReadingPanel, times: NDArray[np.float64], end: float, *, is_last: bool
) -> None:
    """Draw one panel with its title; the last one has the labels of the time axis."""
    panel = PlotPanel(drawing, place, (0, end), readings.panel.limits or _compute_limits(readings))
    x_ticks = panel.choose_x_ticks()
    y_ticks = list(readings.panel.marks) or panel.choose_y_ticks(4)
    panel.add_grid(x_ticks, y_ticks)
    for curve, stroke in zip(readings.curves, _CURVE_STROKES, strict=False):
        panel.add_line(np.column_stack((times, _clip_readings(curve.values))), stroke)
    panel.add_frame(("left", "bottom"))
    panel.add_x_axis(x_ticks, are_ticks_labelled=is_last, label="simulated time, s" if is_last else "")
    panel.add_y_axis(y_ticks)
    title_y = place.bottom + place.height + 0.045
    drawing.add_text(_LEFT_EDGE, title_y, readings.panel.title, size=8, bold=True)
    if len(readings.curves) > 1:
        _label_curves(drawing, readings, title_y)
    if not len(times):
        x, y = place.left + place.width / 2, place.bottom + place.height / 2
        drawing.add_text(x, y, "no time passed", size=8, colour=FAINT, horizontal="center", vertical="center")


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


def _label_curves(drawing: Drawing, panel: ReadingPanel, y: float) -> None:
    right_edge = WIDTH - _RIGHT_EDGE
    for curve, text_x, stroke in zip(panel.curves, (right_edge - 0.86, right_edge - 0.30), _CURVE_STROKES, strict=True):
        drawing.add_text(text_x, y, curve.label, size=8)
        drawing.add_line([(text_x - 0.25, y + 0.045), (text_x - 0.05, y + 0.045)], stroke)
