"""The last frame of a replay as a small PNG, for viewers of a saved notebook that cannot play the replay."""

from __future__ import annotations

import base64
import io
import itertools
import math
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from PIL import Image, ImageDraw

    Point = tuple[float, float]

#: The floor in mm, and the picture in pixels.
_FLOOR_WIDTH, _FLOOR_HEIGHT = 2362, 1143
_WIDTH, _HEIGHT = 480, 270
#: Drawn at this size first, so that lines are smooth.
_OVERSAMPLING = 2
_COLOURS = 48
_MARGIN, _LEAST_WIDTH = 150.0, 640.0  # mm
_INK, _PATH, _PAPER, _BEYOND, _OBSTACLE, _PEN = "#1c2630", "#0b4a86", "#ffffff", "#a3aab1", "#c8cdd2", "#e79b9b"


def draw_last_frame(replay: Mapping[str, Any]) -> bytes | None:
    """Return the end of the replay's first trial as a PNG; None without a trial, or if Pillow is not installed."""
    try:
        from PIL import Image, ImageDraw
    except ImportError:
        return None
    if not replay["trials"]:
        return None
    trial = replay["trials"][replay["first"]]
    paths = [_read_path(robot) for robot in trial["robots"]]
    frame = _Frame([point for path in paths for point in path])
    image = Image.new("RGB", (_WIDTH * _OVERSAMPLING, _HEIGHT * _OVERSAMPLING), _BEYOND)
    _paste_floor(image, frame, replay["floors"][trial["floor"]]["image"])
    draw = ImageDraw.Draw(image)
    for left, bottom, width, height in trial["obstacles"]:
        corners = (*frame.place(left, bottom + height), *frame.place(left + width, bottom))
        draw.rectangle(corners, fill=_OBSTACLE, outline=_INK)
    for robot, path in zip(trial["robots"], paths, strict=True):
        _draw_robot(draw, frame, robot, path)
    small = image.resize((_WIDTH, _HEIGHT), Image.Resampling.LANCZOS)
    # This method keeps the thin lines, whose colours few pixels have.
    small = small.quantize(_COLOURS, method=Image.Quantize.FASTOCTREE, dither=Image.Dither.NONE)
    buffer = io.BytesIO()
    small.save(buffer, "PNG", optimize=True)
    return buffer.getvalue()


class _Frame:
    """The visible part of the floor: all of the paths, with a margin, and as little beyond the floor as possible."""

    def __init__(self, points: Sequence[Point]) -> None:
        xs, ys = zip(*points, strict=True)
        width = max(max(xs) - min(xs) + 2 * _MARGIN, (max(ys) - min(ys) + 2 * _MARGIN) * _WIDTH / _HEIGHT, _LEAST_WIDTH)
        self.scale = _WIDTH * _OVERSAMPLING / width
        height = width * _HEIGHT / _WIDTH
        self._left = _find_first_edge(xs, width, _FLOOR_WIDTH)
        self._top = _find_first_edge(ys, height, _FLOOR_HEIGHT) + height

    def place(self, x: float, y: float) -> Point:
        """Return the pixel of a place on the floor."""
        return (x - self._left) * self.scale, (self._top - y) * self.scale


def _find_first_edge(coordinates: Sequence[float], length: float, floor_length: float) -> float:
    """Return where a view of this length begins: with the path in its middle, or moved towards the floor."""
    least, most = min(coordinates), max(coordinates)
    first, last = sorted((0.0, floor_length - length))
    edge = (least + most - length) / 2
    return max(min(edge, max(last, most + _MARGIN - length)), min(first, least - _MARGIN))


def _read_path(robot: Mapping[str, Any]) -> list[Point]:
    """Return the robot's positions from the start to the end, one for each tick."""
    start = (float(robot["start"][0]), float(robot["start"][1]))
    if "x" not in robot["columns"]:
        return [start]
    xs, ys = (_read_column(robot["columns"][name]) for name in ("x", "y"))
    return [start, *(point for point in zip(xs, ys, strict=True) if math.isfinite(point[0] + point[1]))]


def _read_column(column: Mapping[str, Any]) -> list[float]:
    steps = column["added"][0]
    totals = itertools.accumulate(step or 0 for step in steps)
    return [math.nan if step is None else total / column["per"] for step, total in zip(steps, totals, strict=True)]


def _paste_floor(image: Image.Image, frame: _Frame, data_uri: str | None) -> None:
    from PIL import Image

    corner = frame.place(0, _FLOOR_HEIGHT)
    size = (round(_FLOOR_WIDTH * frame.scale), round(_FLOOR_HEIGHT * frame.scale))
    if data_uri is None:
        floor = Image.new("RGB", size, _PAPER)
    else:
        floor = Image.open(io.BytesIO(base64.b64decode(data_uri.partition(",")[2]))).convert("RGB").resize(size)
    image.paste(floor, (round(corner[0]), round(corner[1])))


def _draw_robot(draw: ImageDraw.ImageDraw, frame: _Frame, robot: Mapping[str, Any], path: Sequence[Point]) -> None:
    """Draw what the pen wrote, the path, and the robot where it ends."""
    places = [frame.place(x, y) for x, y in path]
    is_down, since = False, 0
    for tick, down in [*robot["pen"], (len(places) - 1, False)]:
        if is_down and tick > since:
            draw.line(places[since : tick + 1], fill=_PEN, width=max(4, round(8 * frame.scale)))
        is_down, since = down, tick
    if len(places) > 1:
        draw.line(places, fill=_PAPER, width=4 * _OVERSAMPLING)
        draw.line(places, fill=_PATH, width=2 * _OVERSAMPLING)
    body, end = robot["body"], robot["end"]
    corners = [(body["back"], 1), (body["front"], 1), (body["front"], -1), (body["back"], -1)]
    outline = [_to_place(frame, end, forward, side * body["half_width"]) for forward, side in corners]
    draw.polygon(outline, fill=_PAPER, outline=_INK, width=2 * _OVERSAMPLING)
    for side in ("left", "right"):
        right, forward, diameter = body[side]
        x, y = _to_place(frame, end, forward, -right)
        radius = max(2.0, diameter / 2 * frame.scale)
        draw.ellipse((x - radius, y - radius, x + radius, y + radius), outline=_INK, width=_OVERSAMPLING)


def _to_place(frame: _Frame, pose: Sequence[float], forward: float, left: float) -> Point:
    """Return the pixel of a point of the robot."""
    x, y, heading = pose[0], pose[1], math.radians(pose[2])
    return frame.place(
        x + forward * math.cos(heading) - left * math.sin(heading),
        y + forward * math.sin(heading) + left * math.cos(heading),
    )
