"""Drawing of the robot's path over the floor, with start, end, headings, pen, touches and image positions.

The caller supplies the floor image.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Any

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.markers import MarkerStyle
from matplotlib.patches import Circle, Patch, Polygon, Rectangle
from matplotlib.path import Path
from matplotlib.transforms import Affine2D
from numpy.typing import NDArray

from service.grading.grade import TrialResult
from service.reports.display_text import format_heading, format_whole_number
from service.reports.plots.path_marks import draw_marks, draw_times, to_world
from service.reports.plots.style import (
    FAINT,
    FAULT,
    HEAD,
    INK,
    LEFT,
    PEN,
    RIGHT,
    RULE,
    SECOND_ROBOT,
    WIDTH,
    add_axes,
    create_figure,
    load_font,
    write_text,
)  # fmt: skip
from sim.recording import Pose, Recording
from sim.recording_values import get_recorded_robot

Pixels = NDArray[np.uint8]

FLOOR_WIDTH, FLOOR_HEIGHT = 2362.0, 1143.0
_MARGIN = 90.0  # mm around the path
_MIN_VIEW_SIZE = 520.0  # mm, so that a robot that stands still is shown with its surroundings
_BEYOND = 700.0  # mm outside the floor that are still shown
_WHOLE_FLOOR_SHARE = 0.55  # a path that needs more of the floor than this is shown on all of it
_LEFT_EDGE, _RIGHT_EDGE = 0.56, 0.10  # inches
_LEGEND_COLUMNS = 2
_OFF_THE_FLOOR = "#a3aab1"
_ARROWHEAD = Path([(-0.55, -0.55), (1.0, 0.0), (-0.55, 0.55), (-0.2, 0.0), (-0.55, -0.55)])

_BEACON_STYLE: Mapping[str, Any] = MappingProxyType(
    {"marker": "*", "linestyle": "none", "markersize": 12, "color": RIGHT, "markeredgecolor": INK}
)


@dataclass(frozen=True, slots=True)
class Viewport:
    """The part of the world that is drawn, mm."""

    left: float
    bottom: float
    right: float
    top: float

    @property
    def width(self) -> float:
        """The width, mm."""
        return self.right - self.left

    @property
    def height(self) -> float:
        """The height, mm."""
        return self.top - self.bottom


def draw_path(trial: TrialResult, title: str, floor: Pixels | None) -> Figure:
    """Draw the path of ``trial``'s robot. ``floor`` is (1143, 2362, 3), row 0 at y = 1143 mm; None draws it white."""
    recording = trial.recording
    points = _collect_points(recording)
    partner = recording.partner
    partner_points = _collect_points(partner) if partner is not None else points[:0]
    all_points = np.vstack((points, partner_points))
    view = _choose_viewport(recording, all_points)
    plot_width = WIDTH - _LEFT_EDGE - _RIGHT_EDGE
    plot_height = plot_width * view.height / view.width
    handles = _build_legend(recording, view)
    has_locator = view.width < FLOOR_WIDTH
    legend_rows = -(-len(handles) // _LEGEND_COLUMNS)
    foot_height = 0.42 + max(0.62 if has_locator else 0.0, 0.17 * legend_rows + 0.04)
    figure = create_figure(HEAD + plot_height + foot_height, title, _format_subtitle(trial))
    axes = add_axes(figure, _LEFT_EDGE, foot_height, plot_width, plot_height)
    axes.set_xlim(view.left, view.right)
    axes.set_ylim(view.bottom, view.top)
    axes.set_facecolor(_OFF_THE_FLOOR)
    draw_floor_part(axes, floor, view)
    _draw_obstacles(axes, recording)
    _draw_beacon(axes, recording)
    per_inch = view.width / plot_width  # mm
    if partner is not None:
        _draw_robot_path(axes, partner, partner_points, per_inch, SECOND_ROBOT)
    _draw_robot_path(axes, recording, points, per_inch, LEFT)
    axes.set_xlabel("x, mm", font=load_font(8.5), labelpad=1)
    axes.set_ylabel("y, mm", font=load_font(8.5), labelpad=1)
    figure.legend(
        handles=handles, loc="lower left", bbox_to_anchor=(0.012, 0.0), ncols=_LEGEND_COLUMNS, prop=load_font(8),
        frameon=False, handletextpad=0.5, columnspacing=0.9, labelspacing=0.35, borderaxespad=0.3,
    )  # fmt: skip
    if _has_points_outside(all_points, view):
        axes.text(0.5, 0.03, "the path continues outside this image", transform=axes.transAxes, ha="center",
                  font=load_font(7.5, bold=True), color=INK, zorder=9,
                  bbox={"facecolor": "white", "edgecolor": "none", "pad": 1.5})  # fmt: skip
    if has_locator:
        _draw_locator(figure, floor, view)
    return figure


def _format_subtitle(trial: TrialResult) -> str:
    start, end, recording = trial.recording.start, trial.recording.end, trial.recording
    return (
        f"trial {trial.index + 1}; from ({format_whole_number(start.x)}, {format_whole_number(start.y)}) heading "
        f"{format_heading(start.heading)}° to ({format_whole_number(end.x)}, {format_whole_number(end.y)}) heading "
        f"{format_heading(end.heading)}° in {recording.end_t:.1f} s"
    )


def _collect_points(recording: Recording) -> NDArray[np.float64]:
    """Return x, y and heading of the start and every tick, shape (n + 1, 3), without rows that are not finite."""
    ticks, start = recording.ticks, recording.start
    rows = np.column_stack((ticks.x, ticks.y, ticks.heading)) if len(ticks) else np.empty((0, 3))
    rows = np.vstack(([[start.x, start.y, start.heading]], rows))
    return rows[np.isfinite(rows).all(axis=1)]


def _choose_viewport(recording: Recording, points: NDArray[np.float64]) -> Viewport:
    reach = get_recorded_robot(recording).reach
    positions = points[:, :2] if recording.beacon is None else np.vstack((points[:, :2], [recording.beacon]))
    low_x, low_y = (float(value) for value in positions.min(axis=0))
    high_x, high_y = (float(value) for value in positions.max(axis=0))
    margin = max(_MARGIN, reach + 15)
    view = Viewport(low_x - margin, low_y - margin, high_x + margin, high_y + margin)
    if view.width > _WHOLE_FLOOR_SHARE * FLOOR_WIDTH or view.height > 0.8 * FLOOR_HEIGHT:
        ends = points[[0, -1], :2]
        extent_points = np.vstack((positions - 60, positions + 60, ends - reach - 15, ends + reach + 15))
        (low_x, low_y), (high_x, high_y) = extent_points.min(axis=0), extent_points.max(axis=0)
        view = Viewport(min(0.0, low_x), min(0.0, low_y), max(FLOOR_WIDTH, high_x), max(FLOOR_HEIGHT, high_y))
    left, right = max(view.left, -_BEYOND), min(view.right, FLOOR_WIDTH + _BEYOND)
    bottom, top = max(view.bottom, -_BEYOND), min(view.top, FLOOR_HEIGHT + _BEYOND)
    return _widen_viewport(Viewport(left, bottom, right, top))


def _widen_viewport(view: Viewport) -> Viewport:
    """Return ``view`` widened to a shape between a square and the floor's."""
    width, height = max(view.width, _MIN_VIEW_SIZE), max(view.height, _MIN_VIEW_SIZE / 1.6)
    width = max(width, height * 1.1)
    height = max(height, width * FLOOR_HEIGHT / FLOOR_WIDTH)
    x, y = (view.left + view.right) / 2, (view.bottom + view.top) / 2
    return Viewport(x - width / 2, y - height / 2, x + width / 2, y + height / 2)


def draw_floor_part(axes: Axes, floor: Pixels | None, view: Viewport) -> None:
    """Draw the part of the floor in ``view``, lightened; white if there is no floor."""
    if floor is None:
        axes.add_patch(Rectangle((0, 0), FLOOR_WIDTH, FLOOR_HEIGHT, facecolor="white", edgecolor=RULE))
        return
    rows, columns = floor.shape[:2]
    left, right = max(0, math.floor(view.left)), min(columns, math.ceil(view.right))
    top, bottom = max(0, math.floor(rows - view.top)), min(rows, math.ceil(rows - view.bottom))
    if left >= right or top >= bottom:
        return
    step = 2 if right - left > 1300 else 1
    floor_pixels = floor[top:bottom, left:right].astype(np.float32)
    floor_pixels = floor_pixels[: floor_pixels.shape[0] // step * step, : floor_pixels.shape[1] // step * step]
    floor_pixels = floor_pixels.reshape(
        floor_pixels.shape[0] // step, step, floor_pixels.shape[1] // step, step, 3
    ).mean(axis=(1, 3))
    # Lightened, so that a path over black stays visible and printing saves ink.
    light_pixels = np.rint(72 + floor_pixels * (183 / 255)).astype(np.uint8)
    axes.imshow(
        light_pixels,
        extent=(left, left + light_pixels.shape[1] * step, rows - top - light_pixels.shape[0] * step, rows - top),
        interpolation="nearest",
        aspect="auto",
        zorder=0,
    )


def _draw_obstacles(axes: Axes, recording: Recording) -> None:
    for x, y, width, height in recording.obstacles:
        axes.add_patch(
            Rectangle((x, y), width, height, facecolor="#c8cdd2", edgecolor=INK, hatch="////", linewidth=0.9)
        )


def _draw_beacon(axes: Axes, recording: Recording) -> None:
    if recording.beacon is not None:
        axes.plot(*([value] for value in recording.beacon), **_BEACON_STYLE, zorder=5)


def _draw_robot_path(
    axes: Axes, recording: Recording, points: NDArray[np.float64], per_inch: float, colour: str
) -> None:
    """Draw everything about one robot."""
    _draw_trace(axes, recording, points, colour)
    _draw_robot(axes, recording.start, recording, dashed=True)
    _draw_robot(axes, recording.end, recording, dashed=False)
    draw_times(axes, recording, points, per_inch, colour)
    draw_marks(axes, recording, per_inch, colour if colour != LEFT else INK)


def _draw_trace(axes: Axes, recording: Recording, points: NDArray[np.float64], colour: str) -> None:
    for start_row, end_row in _list_pen_strokes(recording, len(points)):
        axes.plot(
            points[start_row:end_row, 0], points[start_row:end_row, 1], color=PEN, linewidth=5.5, solid_capstyle="round"
        )
    axes.plot(points[:, 0], points[:, 1], color="white", linewidth=3.2, solid_capstyle="round")
    axes.plot(points[:, 0], points[:, 1], color=colour, linewidth=1.5, solid_capstyle="round")
    for index in _select_even_rows(points, 10):
        x, y, heading = points[index]
        axes.plot(
            [x], [y], linestyle="none", marker=MarkerStyle(_ARROWHEAD, transform=Affine2D().rotate_deg(heading)),
            markersize=8, color=colour, markeredgecolor="white", markeredgewidth=0.7, zorder=4,
        )  # fmt: skip


def _list_pen_strokes(recording: Recording, count: int) -> list[tuple[int, int]]:
    """Return the row ranges of the path with the pen down."""
    strokes: list[tuple[int, int]] = []
    start_tick: int | None = None
    for tick, is_down in (*recording.pen, (count, False)):
        if is_down and start_tick is None:
            start_tick = tick
        elif not is_down and start_tick is not None:
            strokes.append((max(0, start_tick), min(count, tick + 1)))
            start_tick = None
    return [(first, last) for first, last in strokes if last - first > 1]


def _select_even_rows(points: NDArray[np.float64], max_count: int) -> list[int]:
    """Return rows at even intervals of distance and turning, without the first and last."""
    steps = np.hypot(np.diff(points[:, 0]), np.diff(points[:, 1])) + 0.8 * np.abs(np.diff(points[:, 2]))
    distances = np.concatenate(([0.0], np.cumsum(steps)))
    count = min(max_count, int(distances[-1] // 60))
    if count < 1:
        return []
    target_distances = distances[-1] * (np.arange(count) + 0.5) / count
    return sorted({int(row) for row in np.searchsorted(distances, target_distances)} - {0, len(points) - 1})


def _draw_robot(axes: Axes, pose: Pose, recording: Recording, *, dashed: bool) -> None:
    if not math.isfinite(pose.x + pose.y + pose.heading):
        return
    robot = get_recorded_robot(recording)
    nose = robot.front
    outline = [
        (-robot.half_width, robot.back), (robot.half_width, robot.back), (robot.half_width, nose * 0.55),
        (robot.half_width * 0.6, nose), (-robot.half_width * 0.6, nose), (-robot.half_width, nose * 0.55),
    ]  # fmt: skip
    axes.add_patch(
        Polygon(
            [to_world(pose, x, y) for x, y in outline],
            closed=True,
            facecolor=(1, 1, 1, 0.12),
            edgecolor=INK,
            linewidth=0.9,
            linestyle=(0, (3, 2)) if dashed else "solid",
            zorder=2.5,
        )
    )
    for sensor, colour in ((robot.left_light, LEFT), (robot.right_light, RIGHT)):
        centre = to_world(pose, sensor.x, sensor.y)
        axes.add_patch(
            Circle(centre, sensor.diameter / 2, facecolor="none", edgecolor=colour, linewidth=0.9, zorder=2.6)
        )


def _has_points_outside(points: NDArray[np.float64], view: Viewport) -> bool:
    x, y = points[:, 0], points[:, 1]
    return bool(((x < view.left) | (x > view.right) | (y < view.bottom) | (y > view.top)).any())


def _build_legend(recording: Recording, view: Viewport) -> list[Artist]:
    """Return a legend handle for every kind of element in the image."""
    handles: list[Artist] = [
        Line2D([], [], marker="o", linestyle="none", markersize=7, color="white", markeredgecolor=INK,
               markeredgewidth=1.6, label="start"),
        Line2D([], [], marker="o", linestyle="none", markersize=5.5, color=INK, label="end"),
        Line2D([], [], color=LEFT, linewidth=1.5, marker=MarkerStyle(_ARROWHEAD), markersize=8,
               markeredgecolor="white", label="path and heading"),
    ]  # fmt: skip
    if recording.partner is not None:
        handles.append(
            Line2D([], [], color=SECOND_ROBOT, linewidth=1.5, marker=MarkerStyle(_ARROWHEAD), markersize=8,
                   markeredgecolor="white", label="path of robot 2")
        )  # fmt: skip
    if any(down for _, down in recording.pen):
        handles.append(Line2D([], [], color=PEN, linewidth=5, label="pen"))
    if recording.images:
        handles.append(
            Line2D([], [], marker="s", linestyle="none", markersize=6.5, color="none", markeredgecolor=INK,
                   markeredgewidth=1.2, label="image sent")
        )  # fmt: skip
    if recording.touches:
        handles.append(
            Line2D([], [], marker="x", linestyle="none", markersize=7, color=FAULT, markeredgewidth=2, label="touch")
        )
    if recording.beacon is not None:
        handles.append(Line2D([], [], **_BEACON_STYLE, label="beacon"))
    if recording.obstacles:
        handles.append(Patch(facecolor="#c8cdd2", edgecolor=INK, hatch="////", label="obstacle"))
    if min(view.left, view.bottom) < -30 or view.right > FLOOR_WIDTH + 30 or view.top > FLOOR_HEIGHT + 30:
        handles.append(Patch(facecolor=_OFF_THE_FLOOR, label="off the floor"))
    return handles


def _draw_locator(figure: Figure, floor: Pixels | None, view: Viewport) -> None:
    width = 0.94
    height = width * FLOOR_HEIGHT / FLOOR_WIDTH
    axes = add_axes(figure, WIDTH - _RIGHT_EDGE - width, 0.06, width, height)
    axes.set_xlim(0, FLOOR_WIDTH)
    axes.set_ylim(0, FLOOR_HEIGHT)
    axes.set_xticks([])
    axes.set_yticks([])
    if floor is not None:
        small_floor = floor[::6, ::6].astype(np.float32)
        axes.imshow(
            np.rint(72 + small_floor * (183 / 255)).astype(np.uint8),
            extent=(0, FLOOR_WIDTH, 0, FLOOR_HEIGHT),
            aspect="auto",
        )
    axes.add_patch(
        Rectangle((view.left, view.bottom), view.width, view.height, facecolor="none", edgecolor=FAULT, linewidth=1.4)
    )
    write_text(figure, WIDTH - _RIGHT_EDGE - width, 0.10 + height, "whole floor", size=8, colour=FAINT)
