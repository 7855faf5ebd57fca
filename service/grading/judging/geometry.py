"""The positions of the robot and its parts over time, relative to areas and lines of the floor.

Geometry only. The modules of the families decide the marks.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from sim.camera import HEIGHT, WIDTH, build_sensor_mask
from sim.light_sensors import Footprint, compute_footprint
from sim.recording import Floats, Pose, Recording
from sim.recording_values import get_pose_after, get_pose_at, get_recorded_robot, tick_to_seconds
from sim.robot import LightSensor
from sim.sentences import Sentence
from sim.trigonometry import sincos
from submissions.criteria.places import Area, LineToFollow, Part, Zone

Side = Literal["left", "right"]
#: The centre of a light sensor or of the axle.
Spot = Side | Literal["middle"]
#: Smaller changes between two ticks count as standing still, mm and degrees.
STILL = 0.01


def compute_times(recording: Recording) -> Floats:
    """Return the times of all rows in seconds, shape (n + 1,)."""
    return np.concatenate([[0.0], recording.ticks.t])


def compute_headings(recording: Recording) -> Floats:
    """Return the headings in degrees, unwrapped, shape (n + 1,)."""
    return np.concatenate([[recording.start.heading], recording.ticks.heading])


def compute_positions(recording: Recording, part: Part = "robot") -> Floats:
    """Return the positions x and y of a part, mm, shape (n + 1, 2). For the pen, rows are NaN while it is up.

    Invalid positions are NaN too, so every comparison with them is false.
    """
    ticks = recording.ticks
    centres = np.column_stack(
        [np.concatenate([[recording.start.x], ticks.x]), np.concatenate([[recording.start.y], ticks.y])]
    )
    if part == "robot":
        return centres
    if part == "pen":
        return np.where(compute_pen_mask(recording)[:, None], centres, np.nan)
    light = find_light_sensor(recording, "left" if part == "left_light" else "right")
    # Local x is to the robot's right and y forward, so the rotation is the heading minus a right angle.
    rotation = np.radians(compute_headings(recording) - 90)
    cosine, sine = np.cos(rotation), np.sin(rotation)
    return centres + np.column_stack([cosine * light.x - sine * light.y, sine * light.x + cosine * light.y])


def compute_pen_mask(recording: Recording) -> NDArray[np.bool_]:
    """Return whether the pen drew on the way to each row, shape (n + 1,), including the first row of each stroke."""
    is_down_mask = np.zeros(len(recording.ticks) + 1, dtype=bool)
    ends = [tick + 1 for tick, _ in recording.pen[1:]] + [len(is_down_mask)]
    for (tick, is_down), end in zip(recording.pen, ends, strict=False):
        is_down_mask[tick:end] |= is_down
    return is_down_mask


def find_place(recording: Recording, row: int) -> tuple[float, Pose]:
    """Return the time and pose of a row."""
    if row <= 0 or not len(recording.ticks):
        return 0.0, recording.start
    return tick_to_seconds(recording, row), get_pose_after(recording, row)


def compute_travel(recording: Recording) -> tuple[Floats, Floats]:
    """Return the motion in each tick: mm along the heading (negative backwards), and degrees. Shapes (n,)."""
    points, degrees = compute_positions(recording), compute_headings(recording)
    radians = np.radians(degrees[:-1])
    steps = np.diff(points, axis=0)
    return steps[:, 0] * np.cos(radians) + steps[:, 1] * np.sin(radians), np.diff(degrees)


def compute_still_mask(recording: Recording) -> NDArray[np.bool_]:
    """Return whether the robot stood still in each tick, shape (n,)."""
    forward_steps, turns = compute_travel(recording)
    return (np.abs(forward_steps) < STILL) & (np.abs(turns) < STILL)


def find_true_runs(mask: NDArray[np.bool_]) -> list[tuple[int, int]]:
    """Return the runs of true entries, as (first, one past the last)."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], mask, [False]]).astype(np.int8)))
    return list(zip(edges[::2].tolist(), edges[1::2].tolist(), strict=True))


def to_relative_position(start: Pose, x: float, y: float) -> tuple[float, float]:
    """Return a point's distance ahead and to the left of a pose, mm."""
    heading = math.radians(start.heading)
    dx, dy = x - start.x, y - start.y
    return dx * math.cos(heading) + dy * math.sin(heading), -dx * math.sin(heading) + dy * math.cos(heading)


def find_light_sensor(recording: Recording, side: Side) -> LightSensor:
    """Return the light sensor of that side, with its mounting position."""
    robot = get_recorded_robot(recording)
    return robot.left_light if side == "left" else robot.right_light


def locate_part(recording: Recording, part: Spot, pose: Pose) -> tuple[float, float]:
    """Return the world position of a light sensor's centre or of the axle, with the robot at ``pose``, mm."""
    if part == "middle":
        return pose.x, pose.y
    return locate_sensor(find_light_sensor(recording, part), pose)


def locate_sensor(sensor: LightSensor, pose: Pose) -> tuple[float, float]:
    """Return the world position of a light sensor's centre, with the robot at ``pose``, mm."""
    turn = math.radians(pose.heading - 90)
    sine, cosine = math.sin(turn), math.cos(turn)
    return pose.x + cosine * sensor.x - sine * sensor.y, pose.y + sine * sensor.x + cosine * sensor.y


def locate_part_at_time(recording: Recording, part: Spot, t: float) -> tuple[float, float]:
    """Return the position as ``locate_part`` does, after the last tick before ``t`` seconds."""
    return locate_part(recording, part, get_pose_at(recording, t))


def locate_footprint(recording: Recording, side: Side, pose: Pose) -> Footprint:
    """Return the window that a light sensor sees. It does not rotate with the robot, so it alone decides the image."""
    return compute_footprint(
        find_light_sensor(recording, side), pose.x, pose.y, *sincos(math.radians(pose.heading) - math.pi / 2)
    )


def measure_floor_share(recording: Recording, side: Side, pose: Pose) -> float:
    """Return the fraction of a light sensor's view that is floor, 0 to 1. Everything else is black."""
    footprint, diameter = locate_footprint(recording, side, pose), find_light_sensor(recording, side).diameter
    rows, columns = footprint.row + np.arange(diameter), footprint.column + np.arange(diameter)
    is_floor = ((rows >= 0) & (rows < HEIGHT))[:, None] & ((columns >= 0) & (columns < WIDTH))
    mask = build_sensor_mask(diameter)
    return float((is_floor & mask).sum() / mask.sum())


def is_in_zone(point: tuple[float, float], zone: Zone, margin: float = 0.0) -> bool:
    """Return whether a place is in [left, bottom, right, top], extended by ``margin`` mm."""
    (x, y), (left, bottom, right, top) = point, zone
    return left - margin <= x <= right + margin and bottom - margin <= y <= top + margin


def describe_zone(zone: Zone) -> str:
    """Return the zone as ``x from 0 to 100 and y from 20 to 80``."""
    left, bottom, right, top = zone
    return Sentence(
        "x from %(left)g to %(right)g and y from %(bottom)g to %(top)g", left=left, right=right, bottom=bottom, top=top
    )


def describe_area(area: Area) -> str:
    """Return ``the red circle``, ``the outside of the red circle``, or the shape with its dimensions."""
    shape = _describe_shape(area)
    return Sentence("the outside of %(area)s", area=shape) if area.outside else shape


def _describe_shape(area: Area) -> str:
    if area.name:
        return area.name
    if area.rectangle is not None:
        return Sentence("the rectangle with %(zone)s", zone=describe_zone(area.rectangle))
    if area.circle is not None:
        x, y, radius = area.circle
        return Sentence("the circle of %(radius)g mm around (%(x)g, %(y)g)", radius=radius, x=x, y=y)
    if area.bar is not None:
        x1, y1, x2, y2, _ = area.bar
        return Sentence("the bar from (%(x1)g, %(y1)g) to (%(x2)g, %(y2)g)", x1=x1, y1=y1, x2=x2, y2=y2)
    x, y = (area.polygon or ((0.0, 0.0),))[0]
    return Sentence("the area with a corner at (%(x)g, %(y)g)", x=x, y=y)


def measure_area_distance(area: Area, points: Floats) -> Floats:
    """Return the signed distance of each point (n, 2) to the edge of the area, mm, negative inside."""
    distances = _measure_shape_distance(area, points)
    return -distances if area.outside else distances


def _measure_shape_distance(area: Area, points: Floats) -> Floats:
    x, y = points[:, 0], points[:, 1]
    if area.circle is not None:
        return np.hypot(x - area.circle[0], y - area.circle[1]) - area.circle[2]
    if area.bar is not None:
        x1, y1, x2, y2, radius = area.bar
        return measure_segment_distance(points, (x1, y1), (x2, y2)) - radius
    corners: tuple[tuple[float, float], ...] = area.polygon or ()
    if area.rectangle is not None:
        left, bottom, right, top = area.rectangle
        corners = ((left, bottom), (right, bottom), (right, top), (left, top))
    edges = list(zip(corners, (*corners[1:], corners[0]), strict=True))
    distances = np.min([measure_segment_distance(points, first, last) for first, last in edges], axis=0)
    is_inside = np.zeros(len(points), dtype=bool)
    for (x1, y1), (x2, y2) in edges:  # from inside, a ray to the right crosses the outline an odd number of times
        is_crossing = (y1 > y) != (y2 > y)
        if y1 != y2:
            is_inside ^= is_crossing & (x < x1 + (y - y1) / (y2 - y1) * (x2 - x1))
    signed_distances: Floats = np.where(is_inside, -distances, distances)
    return signed_distances


def measure_segment_distance(points: Floats, first: tuple[float, float], last: tuple[float, float]) -> Floats:
    """Return the distance of each point (n, 2) to a line segment, mm."""
    start, direction = np.array(first), np.array(last) - np.array(first)
    length = float(direction @ direction)
    share = np.clip((points - start) @ direction / length, 0, 1) if length > 0 else np.zeros(len(points))
    offsets = points - start - share[:, None] * direction
    distances: Floats = np.hypot(offsets[:, 0], offsets[:, 1])
    return distances


#: The smallest search range along the line from one tick to the next, mm.
_WINDOW = 100.0


@dataclass(frozen=True, slots=True)
class LineProgress:
    """The position of each row from ``first`` on, relative to a line.

    ``progress`` is along the line (mm; it grows beyond the length if the line is closed). ``offset`` is the distance
    from it (mm, positive to the left).
    """

    first: int
    progress: Floats
    offset: Floats
    length: float


def track_line_progress(course: LineToFollow, points: Floats, max_distance: float) -> LineProgress | None:
    """Return the path's progress from where it first comes ``max_distance`` mm of the line; None if it never does.

    After that, the nearest point is searched only near the previous one. So a path that leaves the line and meets it
    elsewhere, or crosses it, makes no progress. Cutting a corner at d mm from the line on both sides moves the nearest
    point by 2 d, so a range of twice ``max_distance`` is enough.
    """
    line = _Line(course)
    distances = line.measure_distances(points)
    near_rows = np.flatnonzero(distances <= max_distance)
    if not len(near_rows):
        return None
    first_row = int(near_rows[0])
    progress, offset = np.empty(len(points) - first_row), np.empty(len(points) - first_row)
    position, window = line.find_nearest(points[first_row]), max(_WINDOW, 2.2 * max_distance)
    for row, (x, y) in enumerate(points[first_row:]):
        position, offset[row] = line.step(x, y, position, window)
        progress[row] = position
    return LineProgress(first_row, progress, offset, line.length)


def measure_covered_share(line_progress: LineProgress, max_distance: float, start: float, end: float) -> float:
    """Return the fraction of the line from ``start`` to ``end`` that was driven forwards, ``max_distance`` mm of it."""
    near_mask = np.abs(line_progress.offset) <= max_distance
    pieces = []
    for previous, following, is_near in zip(
        line_progress.progress, line_progress.progress[1:], near_mask[:-1] & near_mask[1:], strict=False
    ):
        if is_near and following > previous:
            pieces.append((max(float(previous), start), min(float(following), end)))
    covered_until, total = start, 0.0
    for low, high in sorted(pieces):
        total += max(high - max(low, covered_until), 0.0)
        covered_until = max(covered_until, high)
    return total / (end - start) if end > start else 0.0


class _Line:
    """The segments of a line, repeated endlessly if it is closed."""

    def __init__(self, course: LineToFollow) -> None:
        corners = np.array(course.corners())
        steps = np.diff(corners, axis=0)
        lengths = np.hypot(*steps.T)
        has_length = lengths > 0
        self._starts, self._lengths = corners[:-1][has_length], lengths[has_length]
        self._directions = steps[has_length] / self._lengths[:, None]
        self._begins = np.concatenate([[0.0], np.cumsum(self._lengths)[:-1]])
        self.length = float(self._lengths.sum())
        self._closed = course.is_closed

    def measure_distances(self, points: Floats) -> Floats:
        return np.array([np.min(self._measure_from(x, y)[1]) for x, y in points])

    def find_nearest(self, point: Floats) -> float:
        progress, distance, _ = self._measure_from(float(point[0]), float(point[1]))
        return float(progress[int(np.argmin(distance))])

    def step(self, x: float, y: float, position: float, window: float) -> tuple[float, float]:
        """Return the nearest place in the window around ``position``, and the signed distance to it."""
        progress, distance, side = self._measure_from(x, y)
        if self._closed:
            progress = position + (progress - position + self.length / 2) % self.length - self.length / 2
        is_allowed = np.abs(progress - position) <= window
        if not is_allowed.any():
            is_allowed = np.abs(progress - position) == np.min(np.abs(progress - position))
        nearest_index = int(np.argmin(np.where(is_allowed, distance, np.inf)))
        return float(progress[nearest_index]), float(np.copysign(distance[nearest_index], side[nearest_index]))

    def _measure_from(self, x: float, y: float) -> tuple[Floats, Floats, Floats]:
        """Return for each segment the nearest place, the distance to it, and the side (positive to the left)."""
        away_x, away_y = x - self._starts[:, 0], y - self._starts[:, 1]
        forward_x, forward_y = self._directions[:, 0], self._directions[:, 1]
        ahead = np.clip(away_x * forward_x + away_y * forward_y, 0, self._lengths)
        side = forward_x * away_y - forward_y * away_x
        distance = np.hypot(away_x - ahead * forward_x, away_y - ahead * forward_y)
        return self._begins + ahead, distance, side
