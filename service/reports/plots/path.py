"""Drawing of the robot's path over the floor, with start, end, headings, pen, touches and image positions.

The caller supplies the floor image.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from matplotlib.markers import MarkerStyle
from matplotlib.path import Path
from matplotlib.transforms import Affine2D
from numpy.typing import NDArray

from service.grading.grade import TrialResult
from service.reports.display_text import format_heading, format_whole_number
from service.reports.plots.drawing import Drawing, Rectangle, Stroke, create_drawing
from service.reports.plots.floor_image import FLOOR_HEIGHT, FLOOR_WIDTH, Viewport, draw_floor_part, draw_small_floor
from service.reports.plots.panel import Panel
from service.reports.plots.path_marks import draw_marks, draw_numbers, draw_times, to_world
from service.reports.plots.style import FAINT, FAULT, HEAD, INK, LEFT, OFF_THE_FLOOR, PEN, RIGHT, SECOND_ROBOT, WIDTH
from sim.floors.canvas import Pixels
from sim.recording import Pose, Recording
from sim.recording_values import get_recorded_robot

_MARGIN = 90.0  # mm around the path
_MIN_VIEW_SIZE = 520.0  # mm, so that a robot that stands still is shown with its surroundings
_BEYOND = 700.0  # mm outside the floor that are still shown
_WHOLE_FLOOR_SHARE = 0.55  # a path that needs more of the floor than this is shown on all of it
_LEFT_EDGE, _RIGHT_EDGE = 0.56, 0.10  # inches
_LEGEND_COLUMNS = 2
_LEGEND_COLUMN_WIDTH, _LEGEND_ROW, _SYMBOL_WIDTH = 1.36, 0.162, 0.24  # inches
_OBSTACLE = "#c8cdd2"
_ARROWHEAD = Path([(-0.55, -0.55), (1.0, 0.0), (-0.55, 0.55), (-0.2, 0.0), (-0.55, -0.55)])
_ANGLES = np.linspace(0, 2 * math.pi, 24, endpoint=False)
_CIRCLE_POINTS = np.column_stack((np.cos(_ANGLES), np.sin(_ANGLES)))
_DOT, _STAR, _SQUARE, _CROSS = MarkerStyle("o"), MarkerStyle("*"), MarkerStyle("s"), MarkerStyle("x")


@dataclass(frozen=True, slots=True)
class _DrivenPath:
    """One robot's recording, its colour, and x, y and heading of the start and every tick, shape (n + 1, 3)."""

    recording: Recording
    points: NDArray[np.float64]
    colour: str


def draw_path(trial: TrialResult, title: str, floor: Pixels | None) -> Drawing:
    """Draw the path of ``trial``'s robot. ``floor`` is (1143, 2362, 3), row 0 at y = 1143 mm; None draws it white."""
    recording = trial.recording
    paths = [_DrivenPath(recording, _collect_points(recording), LEFT)]
    if recording.partner is not None:
        paths.insert(0, _DrivenPath(recording.partner, _collect_points(recording.partner), SECOND_ROBOT))
    all_points = np.vstack([path.points for path in reversed(paths)])
    view = _choose_viewport(recording, all_points)
    plot_width = WIDTH - _LEFT_EDGE - _RIGHT_EDGE
    plot_height = plot_width * view.height / view.width
    legend = _list_legend_entries(recording, view)
    has_locator = view.width < FLOOR_WIDTH
    legend_rows = -(-len(legend) // _LEGEND_COLUMNS)
    foot_height = 0.42 + max(0.62 if has_locator else 0.0, 0.17 * legend_rows + 0.04)
    drawing = create_drawing(HEAD + plot_height + foot_height, title, _format_subtitle(trial))
    place = Rectangle(_LEFT_EDGE, foot_height, plot_width, plot_height)
    panel = Panel(drawing, place, (view.left, view.right), (view.bottom, view.top))
    panel.fill(OFF_THE_FLOOR)
    draw_floor_part(panel, floor, view)
    _draw_surroundings(panel, recording)
    _draw_robots(panel, paths)
    if _has_points_outside(all_points, view):
        panel.add_text(
            view.left + view.width / 2, view.bottom + 0.03 * view.height, "the path continues outside this image",
            bold=True, size=7.5, horizontal="center", background="white",
        )  # fmt: skip
    panel.add_frame()
    panel.add_x_axis(label="x, mm")
    panel.add_y_axis(label="y, mm")
    _draw_legend(drawing, legend)
    if has_locator:
        _draw_locator(drawing, floor, view)
    return drawing


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


def _draw_surroundings(panel: Panel, recording: Recording) -> None:
    for x, y, width, height in recording.obstacles:
        panel.add_rectangle((x, y), width, height, fill=_OBSTACLE, edge=Stroke(INK, 0.9), hatched=True)
    if recording.beacon is not None:
        panel.add_marks([recording.beacon], _STAR, 12, fill=RIGHT, edge=Stroke(INK, 1))


def _draw_robots(panel: Panel, paths: Sequence[_DrivenPath]) -> None:
    """Draw everything about the robots, the important parts last, so that nothing covers them."""
    for path in paths:
        _draw_trace(panel, path)
    for path in paths:
        _draw_robot(panel, path.recording.start, path.recording, dashes=(2.7, 1.8))
        _draw_robot(panel, path.recording.end, path.recording, dashes=())
    for path in paths:
        _draw_arrows(panel, path)
        draw_marks(panel, path.recording, path.colour if path.colour != LEFT else INK)
    for path in paths:
        draw_times(panel, path.recording, path.points, path.colour)
        draw_numbers(panel, path.recording)


def _draw_trace(panel: Panel, path: _DrivenPath) -> None:
    positions = path.points[:, :2]
    for start_row, end_row in _list_pen_strokes(path.recording, len(positions)):
        panel.add_line(positions[start_row:end_row], Stroke(PEN, 5.5))
    panel.add_line(positions, Stroke("white", 3.2))
    panel.add_line(positions, Stroke(path.colour, 1.5))


def _draw_arrows(panel: Panel, path: _DrivenPath) -> None:
    for index in _select_even_rows(path.points, 10):
        x, y, heading = path.points[index]
        panel.add_marks([(x, y)], _rotate_arrowhead(heading), 8, fill=path.colour, edge=Stroke("white", 0.7))


def _rotate_arrowhead(heading: float) -> MarkerStyle:
    return MarkerStyle(_ARROWHEAD, transform=Affine2D().rotate_deg(heading))


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


def _draw_robot(panel: Panel, pose: Pose, recording: Recording, *, dashes: tuple[float, ...]) -> None:
    if not math.isfinite(pose.x + pose.y + pose.heading):
        return
    robot = get_recorded_robot(recording)
    nose = robot.front
    outline = [
        (-robot.half_width, robot.back), (robot.half_width, robot.back), (robot.half_width, nose * 0.55),
        (robot.half_width * 0.6, nose), (-robot.half_width * 0.6, nose), (-robot.half_width, nose * 0.55),
    ]  # fmt: skip
    corners = [to_world(pose, x, y) for x, y in outline]
    panel.add_area(corners, fill="white", opacity=0.12, edge=Stroke(INK, 0.9, dashes))
    for sensor, colour in ((robot.left_light, LEFT), (robot.right_light, RIGHT)):
        x, y = to_world(pose, sensor.x, sensor.y)
        panel.add_area(_CIRCLE_POINTS * (sensor.diameter / 2) + (x, y), edge=Stroke(colour, 0.9))


def _has_points_outside(points: NDArray[np.float64], view: Viewport) -> bool:
    x, y = points[:, 0], points[:, 1]
    return bool(((x < view.left) | (x > view.right) | (y < view.bottom) | (y > view.top)).any())


@dataclass(frozen=True, slots=True)
class _LegendEntry:
    """One kind of element and how its symbol is drawn around a point of the drawing."""

    label: str
    draw: Callable[[Drawing, float, float], None]


def _list_legend_entries(recording: Recording, view: Viewport) -> list[_LegendEntry]:
    """Return an entry for every kind of element in the image."""
    entries = [
        _LegendEntry("start", _mark(_DOT, 7, "white", Stroke(INK, 1.6))),
        _LegendEntry("end", _mark(_DOT, 5.5, INK, Stroke(INK, 1))),
        _LegendEntry("path and heading", _arrow(LEFT)),
    ]
    if recording.partner is not None:
        entries.append(_LegendEntry("path of robot 2", _arrow(SECOND_ROBOT)))
    if any(is_down for _, is_down in recording.pen):
        entries.append(_LegendEntry("pen", _stroke(Stroke(PEN, 5))))
    if recording.images:
        entries.append(_LegendEntry("image sent", _mark(_SQUARE, 6.5, None, Stroke(INK, 1.2))))
    if recording.touches:
        entries.append(_LegendEntry("touch", _mark(_CROSS, 7, None, Stroke(FAULT, 2))))
    if recording.beacon is not None:
        entries.append(_LegendEntry("beacon", _mark(_STAR, 12, RIGHT, Stroke(INK, 1))))
    if recording.obstacles:
        entries.append(_LegendEntry("obstacle", _box(_OBSTACLE, Stroke(INK, 1), hatched=True)))
    if min(view.left, view.bottom) < -30 or view.right > FLOOR_WIDTH + 30 or view.top > FLOOR_HEIGHT + 30:
        entries.append(_LegendEntry("off the floor", _box(OFF_THE_FLOOR, None, hatched=False)))
    return entries


def _mark(marker: MarkerStyle, size: float, fill: str | None, edge: Stroke) -> Callable[[Drawing, float, float], None]:
    return lambda drawing, x, y: drawing.add_marks([(x, y)], marker, size, fill, edge)


def _stroke(stroke: Stroke) -> Callable[[Drawing, float, float], None]:
    half = _SYMBOL_WIDTH / 2
    return lambda drawing, x, y: drawing.add_line([(x - half, y), (x + half, y)], stroke)


def _arrow(colour: str) -> Callable[[Drawing, float, float], None]:
    def draw(drawing: Drawing, x: float, y: float) -> None:
        _stroke(Stroke(colour, 1.5))(drawing, x, y)
        drawing.add_marks([(x, y)], MarkerStyle(_ARROWHEAD), 8, colour, Stroke("white", 1))

    return draw


def _box(fill: str, edge: Stroke | None, *, hatched: bool) -> Callable[[Drawing, float, float], None]:
    width, height = _SYMBOL_WIDTH, 0.08
    return lambda drawing, x, y: drawing.add_rectangle(
        Rectangle(x - width / 2, y - height / 2, width, height), fill=fill, edge=edge, hatched=hatched
    )


def _draw_legend(drawing: Drawing, entries: Sequence[_LegendEntry]) -> None:
    """Draw the entries in columns at the lower left, filled column by column.

    They are on a white card, so that they have the colours of the plot on a dark page too.
    """
    rows = -(-len(entries) // _LEGEND_COLUMNS)
    width = _LEGEND_COLUMN_WIDTH * min(_LEGEND_COLUMNS, -(-len(entries) // rows))
    drawing.add_rectangle(Rectangle(0.04, 0.0, width, _LEGEND_ROW * rows + 0.02), fill="white")
    for number, entry in enumerate(entries):
        column, row = divmod(number, rows)
        x = 0.08 + _SYMBOL_WIDTH / 2 + column * _LEGEND_COLUMN_WIDTH
        y = 0.09 + (rows - 1 - row) * _LEGEND_ROW
        entry.draw(drawing, x, y)
        drawing.add_text(x + _SYMBOL_WIDTH / 2 + 0.055, y, entry.label, size=8, vertical="middle")


def _draw_locator(drawing: Drawing, floor: Pixels | None, view: Viewport) -> None:
    """Draw the whole floor, small, at the lower right, with a frame around the part that is shown."""
    width = 0.94
    height = width * FLOOR_HEIGHT / FLOOR_WIDTH
    left = WIDTH - _RIGHT_EDGE - width
    panel = Panel(drawing, Rectangle(left, 0.06, width, height), (0, FLOOR_WIDTH), (0, FLOOR_HEIGHT))
    if floor is not None:
        draw_small_floor(panel, floor)
    panel.add_frame()
    panel.add_rectangle((view.left, view.bottom), view.width, view.height, edge=Stroke(FAULT, 1.4))
    drawing.add_text(left, 0.10 + height, "whole floor", size=8, colour=FAINT)
