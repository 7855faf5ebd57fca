"""An animated GIF of one trial: the robot on its floor with its pen, the time, and printed, said and sent texts.

It shows the same as the replay, for places that cannot run scripts. It plays for less than a minute, however long the
trial was: time is sped up so that a few hundred frames are enough.
"""

from __future__ import annotations

import io
import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageColor, ImageDraw

from service.grading.grade import TrialResult
from service.reports.film_captions import Caption, draw_caption_strip
from service.reports.messages import iterate_robots
from service.reports.plots.style import (
    FAINT,
    FAULT,
    INK,
    LEFT,
    PEN,
    RIGHT,
    RULE,
    SECOND_ROBOT,
)
from sim.recording import Pose, Recording
from sim.recording_values import count_ticks_until, get_pose_after, get_recorded_robot, rebuild_floor
from sim.robot import LightSensor

Pixels = NDArray[np.uint8]
Point = tuple[float, float]

#: Frame duration in milliseconds. A GIF counts in hundredths of a second.
FRAME_MILLISECONDS = 80
MAX_FRAMES = 300
_LAST_FRAME_MILLISECONDS = 2000
_WIDTH, _LOWEST, _HIGHEST, _STRIP = 640, 240, 420, 50  # pixels
_MARGIN, _BEYOND, _CLOSEST = 150, 400, 640  # mm
_FLOOR_WIDTH, _FLOOR_HEIGHT = 2362, 1143  # mm
_OFF_THE_FLOOR, _PAPER, _OBSTACLE, _RAY = "#a3aab1", "#ffffff", "#c8cdd2", "#3f7d3c"
_COLOURS = (INK, LEFT, RIGHT, PEN, FAULT, SECOND_ROBOT, FAINT, RULE, _OFF_THE_FLOOR, _PAPER, _OBSTACLE, _RAY)
_IMAGE_COLOURS, _TOO_NEAR = 150, 8
_OVERSAMPLING = 3  # drawings are enlarged by this factor first, for smooth edges
_ULTRASONIC_LIMIT = 2550  # mm
_MARGIN = 8  # pixels around the points of a layer


@dataclass(frozen=True, slots=True)
class _Viewport:
    """The part of the world that is shown: its upper left corner in mm, and the scale in pixels per mm."""

    left: float
    top: float
    scale: float
    height: int  # pixels

    def at(self, x: float, y: float) -> Point:
        return (x - self.left) * self.scale, (self.top - y) * self.scale


def render_film(trial: TrialResult, own_floors: Mapping[str, Pixels]) -> bytes:
    """Return the trial as a GIF. ``own_floors`` are floors that are not built in, by name."""
    recording = trial.recording
    viewport = _choose_viewport(recording)
    ground = _draw_ground(recording, own_floors.get(recording.background), viewport)
    speed = max(1, math.ceil(recording.end_t * 1000 / FRAME_MILLISECONDS / (MAX_FRAMES - 1)))
    palette = _build_palette(_draw_frames(trial, ground.copy(), viewport, speed, (0.0, recording.end_t)))
    moments = [*np.arange(0, recording.end_t, FRAME_MILLISECONDS / 1000 * speed).tolist(), recording.end_t]
    frames = (
        frame.quantize(palette=palette, dither=Image.Dither.NONE)
        for frame in _draw_frames(trial, ground, viewport, speed, moments)
    )
    durations = [FRAME_MILLISECONDS] * (len(moments) - 1) + [_LAST_FRAME_MILLISECONDS]
    stream = io.BytesIO()
    next(frames).save(
        stream, "GIF", save_all=True, append_images=frames, duration=durations, loop=0, optimize=False, disposal=1
    )
    return stream.getvalue()


def _draw_frames(
    trial: TrialResult, ground: Image.Image, viewport: _Viewport, speed: int, moments: list[float] | tuple[float, ...]
) -> Iterator[Image.Image]:
    """Yield a frame for each moment. Trails of the robots are drawn on ``ground``."""
    recording = trial.recording
    caption = Caption(trial)
    robot_recordings = [own for _, own in iterate_robots(recording)]
    drawn_tick, marked_time = 0, -math.inf
    for frame_number, t in enumerate(moments):
        tick = count_ticks_until(recording, t)
        for robot_index, robot_recording in enumerate(robot_recordings):
            _draw_trail(ground, robot_recording, viewport, drawn_tick, tick, SECOND_ROBOT if robot_index else LEFT)
            _draw_touches(ground, robot_recording, viewport, marked_time, t)
        drawn_tick, marked_time = tick, t
        scene = ground.copy()
        for robot_index, robot_recording in enumerate(robot_recordings):
            _draw_robot(scene, robot_recording, viewport, tick, SECOND_ROBOT if robot_index else INK)
        frame = Image.new("RGB", (_WIDTH, viewport.height + _STRIP), _PAPER)
        frame.paste(scene)
        draw_caption_strip(frame, viewport.height, t, recording.end_t, speed, caption.at(t, frame_number))
        yield frame


def _choose_viewport(recording: Recording) -> _Viewport:
    """Return the region that the robots visited, with a margin, in the aspect ratio of a screen."""
    positions = np.vstack([_collect_positions(own) for _, own in iterate_robots(recording)])
    if recording.beacon is not None:
        positions = np.vstack((positions, recording.beacon))
    positions = positions[np.isfinite(positions).all(axis=1)] if np.isfinite(positions).any() else np.zeros((1, 2))
    upper_limit = (_FLOOR_WIDTH + _BEYOND, _FLOOR_HEIGHT + _BEYOND)
    low = np.clip(positions.min(axis=0), -_BEYOND, upper_limit) - _MARGIN
    high = np.clip(positions.max(axis=0), -_BEYOND, upper_limit) + _MARGIN
    span_x, span_y = (high - low).tolist()
    height = round(min(max(_WIDTH * span_y / span_x, _LOWEST), _HIGHEST))
    scale = min(_WIDTH / max(span_x, _CLOSEST), height / span_y)
    middle_x, middle_y = ((low + high) / 2).tolist()
    return _Viewport(middle_x - _WIDTH / scale / 2, middle_y + height / scale / 2, scale, height)


def _collect_positions(recording: Recording) -> NDArray[np.float64]:
    start = np.array([[recording.start.x, recording.start.y]])
    return np.vstack((start, np.column_stack((recording.ticks.x, recording.ticks.y))))


def _draw_ground(recording: Recording, own_floor: Pixels | None, viewport: _Viewport) -> Image.Image:
    """Return the floor of the trial with its obstacles; white if the floor image is not available any more."""
    ground = Image.new("RGB", (_WIDTH, viewport.height), _OFF_THE_FLOOR)
    built_in = rebuild_floor(recording) if own_floor is None else None
    pixels = own_floor if built_in is None else built_in.pixels
    if pixels is None:
        pixels = np.full((_FLOOR_HEIGHT, _FLOOR_WIDTH, 3), 255, np.uint8)
    image = Image.fromarray(np.ascontiguousarray(pixels[:, :, :3]))
    pixels_per_mm = image.width / _FLOOR_WIDTH
    left, right = (min(max(x, 0.0), _FLOOR_WIDTH) for x in (viewport.left, viewport.left + _WIDTH / viewport.scale))
    bottom, top = (
        min(max(y, 0.0), _FLOOR_HEIGHT) for y in (viewport.top - viewport.height / viewport.scale, viewport.top)
    )
    corner, opposite_corner = viewport.at(left, top), viewport.at(right, bottom)
    size = (max(1, round(opposite_corner[0]) - round(corner[0])), max(1, round(opposite_corner[1]) - round(corner[1])))
    box = (
        left * pixels_per_mm,
        (_FLOOR_HEIGHT - top) * pixels_per_mm,
        right * pixels_per_mm,
        (_FLOOR_HEIGHT - bottom) * pixels_per_mm,
    )
    if right > left and top > bottom:
        ground.paste(image.resize(size, Image.Resampling.LANCZOS, box=box), (round(corner[0]), round(corner[1])))
    draw = ImageDraw.Draw(ground)
    for x, y, obstacle_width, obstacle_height in recording.obstacles:
        draw.rectangle(
            (*viewport.at(x, y + obstacle_height), *viewport.at(x + obstacle_width, y)), fill=_OBSTACLE, outline=INK
        )
    if recording.beacon is not None:
        x, y = viewport.at(*recording.beacon)
        points = [
            (x + (4.5 if point % 2 else 11) * math.sin(point * math.pi / 5),
             y - (4.5 if point % 2 else 11) * math.cos(point * math.pi / 5))
            for point in range(10)
        ]  # fmt: skip
        with _Layer(ground, points) as layer:
            layer.polygon(points, RIGHT, INK, 1)
    return ground


def _draw_trail(
    ground: Image.Image, recording: Recording, viewport: _Viewport, start_tick: int, end_tick: int, colour: str
) -> None:
    """Draw the path from one tick to the other, and the pen strokes on it."""
    end_tick = min(end_tick, len(recording.ticks))
    if end_tick <= start_tick:
        return
    trail = _project_positions(recording, viewport, start_tick, end_tick)
    with _Layer(ground, trail) as layer:
        for pen_down_tick, pen_up_tick in _list_pen_strokes(recording):
            if max(start_tick, pen_down_tick) < min(end_tick, pen_up_tick):
                stroke = _project_positions(
                    recording, viewport, max(start_tick, pen_down_tick), min(end_tick, pen_up_tick)
                )
                layer.line(stroke, PEN, max(7.0, 8 * viewport.scale))
        layer.line(trail, _PAPER, 4)
        layer.line(trail, colour, 2)


def _project_positions(recording: Recording, viewport: _Viewport, start_tick: int, end_tick: int) -> list[Point]:
    """Return the robot's known positions on the frame, from one tick to the other."""
    poses = (get_pose_after(recording, tick) for tick in range(start_tick, end_tick + 1))
    return [viewport.at(pose.x, pose.y) for pose in poses if math.isfinite(pose.x + pose.y)]


def _list_pen_strokes(recording: Recording) -> list[tuple[int, int]]:
    """Return the ticks at which the pen goes down and up, as pairs."""
    strokes: list[tuple[int, int]] = []
    start_tick = None
    for tick, is_down in (*recording.pen, (len(recording.ticks), False)):
        if is_down and start_tick is None:
            start_tick = tick
        elif not is_down and start_tick is not None:
            strokes.append((start_tick, tick))
            start_tick = None
    return strokes


def _draw_touches(
    ground: Image.Image, recording: Recording, viewport: _Viewport, start_time: float, end_time: float
) -> None:
    """Draw a cross for each touch after ``start_time`` up to ``end_time``."""
    for touch in recording.touches:
        if start_time < touch.t <= end_time and math.isfinite(touch.pose.x + touch.pose.y):
            x, y = viewport.at(touch.pose.x, touch.pose.y)
            for stroke in ([(x - 6, y - 6), (x + 6, y + 6)], [(x - 6, y + 6), (x + 6, y - 6)]):
                with _Layer(ground, stroke) as layer:
                    layer.line(stroke, FAULT, 2.5)


def _draw_robot(frame: Image.Image, recording: Recording, viewport: _Viewport, tick: int, colour: str) -> None:
    body, pose = get_recorded_robot(recording), get_pose_after(recording, tick)
    if not math.isfinite(pose.x + pose.y + pose.heading):
        return
    robot_frame = _RobotFrame(pose, viewport)
    row = min(tick, len(recording.ticks)) - 1
    distance = float(recording.ticks.ultrasonic[row]) if row >= 0 else math.nan
    ray = [robot_frame.at(0, body.ultrasonic_y), robot_frame.at(0, body.ultrasonic_y + distance)]
    visible_ray = ray if distance < _ULTRASONIC_LIMIT else []
    outline = robot_frame.build_rounded_outline(-body.half_width, body.back, body.half_width, body.front, 12)
    with _Layer(frame, [*outline, *visible_ray]) as layer:
        if visible_ray:
            layer.dashes(ray[0], ray[1], _RAY, 1.5)
            layer.dot(ray[1], 3.5, _RAY)
        layer.polygon(outline, "#ffffffb4", colour, 1.8)
        wheel = body.wheel_diameter
        for side in (-1, 1):
            wheel_centre = side * body.wheel_spacing / 2
            layer.polygon(
                robot_frame.build_rounded_outline(
                    wheel_centre - 0.18 * wheel, -wheel / 2, wheel_centre + 0.18 * wheel, wheel / 2, 4
                ),
                INK,
            )
        lights = (
            (body.left_light, recording.ticks.left_rgb, LEFT),
            (body.right_light, recording.ticks.right_rgb, RIGHT),
        )
        for sensor, column, edge in lights:
            layer.dot(robot_frame.at(sensor.x, sensor.y), _compute_light_radius(sensor, viewport) + 1.6, edge)
            has_reading = row >= 0 and bool(np.isfinite(column[row]).all())
            light = tuple(np.clip(column[row], 0, 255).astype(int).tolist()) if has_reading else (255, 255, 255)
            layer.dot(robot_frame.at(sensor.x, sensor.y), _compute_light_radius(sensor, viewport), light)
        layer.dot(robot_frame.at(0, 0), 4, _PAPER)
        layer.dot(robot_frame.at(0, 0), 2.6, colour)


def _compute_light_radius(sensor: LightSensor, viewport: _Viewport) -> float:
    return sensor.diameter / 2 * viewport.scale


@dataclass(frozen=True, slots=True)
class _RobotFrame:
    """Converts a robot's own points to the frame: x to its right, y forward, mm."""

    pose: Pose
    viewport: _Viewport

    def at(self, right: float, forward: float) -> Point:
        cosine, sine = math.cos(math.radians(self.pose.heading)), math.sin(math.radians(self.pose.heading))
        return self.viewport.at(
            self.pose.x + forward * cosine + right * sine, self.pose.y + forward * sine - right * cosine
        )

    def build_rounded_outline(self, left: float, back: float, right: float, front: float, radius: float) -> list[Point]:
        """Return a rectangle with round corners."""
        corners = ((right, front, 0), (left, front, 90), (left, back, 180), (right, back, 270))
        points = []
        for x, y, start_angle in corners:
            for angle in range(start_angle, start_angle + 91, 30):
                cosine, sine = math.cos(math.radians(angle)), math.sin(math.radians(angle))
                inner_x = x - radius if x == right else x + radius
                inner_y = y - radius if y == front else y + radius
                points.append(self.at(inner_x + radius * cosine, inner_y + radius * sine))
        return points


class _Layer:
    """A part of an image around some points, drawn enlarged and scaled down onto the image on exit."""

    def __init__(self, image: Image.Image, points: list[Point]) -> None:
        self._image = image
        x_values, y_values = ([point[axis] for point in points] or [0.0] for axis in (0, 1))
        self._left, self._top = (max(0, math.floor(min(values)) - _MARGIN) for values in (x_values, y_values))
        right = min(image.width, math.ceil(max(x_values)) + _MARGIN)
        bottom = min(image.height, math.ceil(max(y_values)) + _MARGIN)
        self._size = max(0, right - self._left), max(0, bottom - self._top)
        self._layer = Image.new("RGBA", (self._size[0] * _OVERSAMPLING, self._size[1] * _OVERSAMPLING))
        self._draw = ImageDraw.Draw(self._layer)

    def __enter__(self) -> _Layer:
        return self

    def __exit__(self, *_: object) -> None:
        if 0 not in self._size:
            reduced_layer = self._layer.resize(self._size, Image.Resampling.BOX)
            self._image.paste(reduced_layer, (self._left, self._top), reduced_layer)

    def line(self, points: list[Point], colour: str, width: float) -> None:
        enlarged_points = [self._enlarge(point) for point in points]
        if len(set(enlarged_points)) > 1:
            self._draw.line(enlarged_points, fill=colour, width=round(width * _OVERSAMPLING), joint="curve")

    def dashes(self, start_point: Point, end_point: Point, colour: str, width: float) -> None:
        length = math.dist(start_point, end_point)
        for dash_start in np.arange(0, length, 10).tolist():
            start_fraction, end_fraction = dash_start / length, min(dash_start + 6, length) / length
            dash = [
                tuple(np.add(start_point, np.multiply(np.subtract(end_point, start_point), part)).tolist())
                for part in (start_fraction, end_fraction)
            ]
            self._draw.line([self._enlarge((x, y)) for x, y in dash], fill=colour, width=round(width * _OVERSAMPLING))

    def polygon(self, points: list[Point], fill: str, outline: str | None = None, width: float = 1) -> None:
        enlarged_points = [self._enlarge(point) for point in points]
        self._draw.polygon(enlarged_points, fill=fill)
        if outline is not None:
            self._draw.line(
                [*enlarged_points, *enlarged_points[:2]],
                fill=outline,
                width=round(width * _OVERSAMPLING),
                joint="curve",
            )

    def dot(self, centre: Point, radius: float, colour: str | tuple[int, ...]) -> None:
        self._draw_circle(self._enlarge(centre), radius * _OVERSAMPLING, colour)

    def _draw_circle(self, centre: Point, radius: float, colour: str | tuple[int, ...]) -> None:
        x, y = centre
        self._draw.ellipse((x - radius, y - radius, x + radius, y + radius), fill=colour)

    def _enlarge(self, point: Point) -> Point:
        return (point[0] - self._left) * _OVERSAMPLING, (point[1] - self._top) * _OVERSAMPLING


def _build_palette(frames: Iterator[Image.Image]) -> Image.Image:
    """Return one palette for the whole film, from its first and last frame and all drawing colours."""
    first_frame, last_frame = (frame.copy() for frame in frames)
    sample = Image.new("RGB", (_WIDTH, first_frame.height + last_frame.height))
    sample.paste(first_frame)
    sample.paste(last_frame, (0, first_frame.height))
    quantized = sample.quantize(_IMAGE_COLOURS, Image.Quantize.MEDIANCUT, dither=Image.Dither.NONE)
    image_colours = np.reshape(quantized.getpalette() or [], (-1, 3))[:_IMAGE_COLOURS]
    exact_colours = np.array([ImageColor.getrgb(colour) for colour in _COLOURS])
    # A pixel gets the first colour that is close, so similar colours would tint white areas.
    remaining_colours = image_colours[
        np.abs(image_colours[:, None] - exact_colours).max(axis=2).min(axis=1) > _TOO_NEAR
    ]
    palette = Image.new("P", (1, 1))
    palette.putpalette(np.vstack((exact_colours, remaining_colours)).ravel().tolist())
    return palette
