"""Labels along a path: times, start, end, touches, and image positions.

``path.py`` draws the path itself, the floor and the robot.
"""

from __future__ import annotations

import math

import numpy as np
from matplotlib.markers import MarkerStyle
from numpy.typing import NDArray

from service.reports.plots.drawing import Stroke
from service.reports.plots.panel import Panel
from service.reports.plots.style import FAULT, INK, SECOND_ROBOT
from sim.recording import Pose, Recording
from sim.recording_values import count_ticks_until, get_recorded_robot

_DOT, _CROSS = MarkerStyle("o"), MarkerStyle("x")
_TIME_SIZE, _NUMBER_SIZE = 7.6, 7.8  # points
_LABEL_OFFSETS = 0.17, 0.15  # inches to the centre of a time
_LINE = 0.16  # inches between two words above each other


def to_world(pose: Pose, x: float, y: float) -> tuple[float, float]:
    """Return the world coordinates of a point of the robot (x right, y forward, mm)."""
    angle = math.radians(pose.heading - 90)
    cos, sin = math.cos(angle), math.sin(angle)
    return pose.x + cos * x - sin * y, pose.y + sin * x + cos * y


def draw_times(panel: Panel, recording: Recording, points: NDArray[np.float64], colour: str) -> None:
    """Write small times along the path, at distances that keep them readable.

    ``points`` are x, y in mm and the heading in degrees, row by row.
    """
    per_inch = _measure_scale(panel)
    ends = ((recording.start.x, recording.start.y), (recording.end.x, recording.end.y))
    occupied_points = [end for end in ends if math.isfinite(sum(end))]
    step = next((s for s in (1, 2, 5, 10, 20, 50, 100, 200) if recording.end_t / s <= 9), 500)
    for second in range(step, math.ceil(recording.end_t), step):
        row = count_ticks_until(recording, second)
        if row >= len(points):
            break
        x, y = float(points[row, 0]), float(points[row, 1])
        if any(math.hypot(x - other[0], y - other[1]) < 0.33 * per_inch for other in occupied_points):
            continue
        occupied_points.append((x, y))
        panel.add_marks([(x, y)], _DOT, 3, fill="white", edge=Stroke(colour, 0.9))
        text = f"{second} s"
        # On the robot's right, and for the second robot on its left, because both may drive the same way.
        angle = math.radians(float(points[row, 2]) + (90 if colour == SECOND_ROBOT else -90))
        candidates = [
            (
                x + way * _LABEL_OFFSETS[0] * per_inch * math.cos(angle),
                y + way * _LABEL_OFFSETS[1] * per_inch * math.sin(angle),
            )
            for way in (1, -1)
        ]
        free_positions = [
            side for side in candidates if _is_in_view(panel, *side, text) and _is_clear(side, recording, per_inch)
        ]
        if free_positions:
            _draw_tag(panel, *free_positions[0], text, _TIME_SIZE, colour if colour == SECOND_ROBOT else INK)


def draw_marks(panel: Panel, recording: Recording, colour: str) -> None:
    """Draw the places of images, touches, the start and the end."""
    sensor = get_recorded_robot(recording).left_light
    for image in recording.images:
        x, y = to_world(image.pose, sensor.x, sensor.y)
        for edge in (Stroke("white", 2.4), Stroke(INK, 1.2)):
            panel.add_rectangle((x - image.side / 2, y - image.side / 2), image.side, image.side, edge=edge)
    touches = [(touch.pose.x, touch.pose.y) for touch in recording.touches[:40]]
    if touches:
        panel.add_marks(touches, _CROSS, 9, edge=Stroke("white", 4))
        panel.add_marks(touches, _CROSS, 8, edge=Stroke(FAULT, 2))
    start, end = recording.start, recording.end
    panel.add_marks([(start.x, start.y)], _DOT, 7, fill="white", edge=Stroke(colour, 1.6))
    panel.add_marks([(end.x, end.y)], _DOT, 5.5, fill=colour, edge=Stroke("white", 0.8))


def draw_numbers(panel: Panel, recording: Recording) -> None:
    """Write the numbers of the images beside their places; one for images at the same place."""
    per_inch = _measure_scale(panel)
    sensor = get_recorded_robot(recording).left_light
    numbers_by_place: dict[tuple[int, int], list[int]] = {}
    for count, image in enumerate(recording.images, start=1):
        x, y = to_world(image.pose, sensor.x, sensor.y)
        numbers_by_place.setdefault((round(x / 8), round(y / 8)), []).append(count)
    tag_positions: list[tuple[float, float]] = []
    # The last one first, so that its number is kept if places are too close together.
    for (column, row), counts in reversed(numbers_by_place.items()):
        text = str(counts[0]) if len(counts) == 1 else f"{counts[0]}–{counts[-1]}"
        x, y = column * 8.0, row * 8 + 10 + 0.10 * per_inch
        min_distance = 2 * _estimate_half_width(text) * per_inch
        if all(abs(x - other[0]) > min_distance or abs(y - other[1]) > _LINE * per_inch for other in tag_positions):
            tag_positions.append((x, y))
            _draw_tag(panel, x, y, text, _NUMBER_SIZE)


def _measure_scale(panel: Panel) -> float:
    """Return the mm that an inch of the drawing shows."""
    return (panel.x_limits[1] - panel.x_limits[0]) / panel.place.width


def _estimate_half_width(text: str) -> float:
    """Return about half the width of a time or a number, inches."""
    return 0.032 * len(text) + 0.03


def _is_clear(position: tuple[float, float], recording: Recording, per_inch: float) -> bool:
    """Return whether a time at this place would not overlap a touch."""
    return all(math.dist(position, (touch.pose.x, touch.pose.y)) > 0.26 * per_inch for touch in recording.touches[:40])


def _is_in_view(panel: Panel, x: float, y: float, text: str) -> bool:
    (left, right), (bottom, top) = panel.x_limits, panel.y_limits
    per_inch = _measure_scale(panel)
    width, height = _estimate_half_width(text) * per_inch, _LINE / 2 * per_inch
    return left + width <= x <= right - width and bottom + height <= y <= top - height


def _draw_tag(panel: Panel, x: float, y: float, text: str, size: float, colour: str = INK) -> None:
    panel.add_text(
        x, y, text, size=size, colour=colour, horizontal="center", vertical="center", background="white", clipped=True
    )
