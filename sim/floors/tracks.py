"""Floors with tracks to follow: test lines, lines with obstacles, junctions and the Thruxton circuit.

The images have smooth edges and use image coordinates (y down). The named centrelines use world coordinates (mm, y up),
in the driving direction, clipped at the floor's edges.
"""

from __future__ import annotations

import functools
import itertools
import json
import math
from collections.abc import Mapping
from dataclasses import dataclass
from importlib import resources
from types import MappingProxyType

from sim.floors.canvas import BLACK, HEIGHT, RED, WHITE, Pixels, Point, SmoothCanvas, make_grey
from sim.floors.registry import Obstacle, register_floor
from sim.recording import Pose

#: The lines of Line_Following_Test in the order of the data file. Each name is the x where the line starts, with
#: ``high`` for lines that start half-way up. The broken line with its three parts is not included.
_TEST_LINES = ("141", "440", "771", "1076", "1453-high", "1453", "1821", "1821-high")


@dataclass(frozen=True, slots=True)
class TrackLine:
    """A centreline in image pixels, and the width of its line."""

    width: float
    points: tuple[Point, ...]


def load_track_lines(file_name: str) -> tuple[TrackLine, ...]:
    """Return the centrelines in a data file of this package."""
    text = resources.files(__package__).joinpath(file_name).read_text(encoding="utf-8")
    return tuple(
        TrackLine(line["width"], tuple((x, y) for x, y in line["points"])) for line in json.loads(text)["lines"]
    )


@register_floor("Line_Following_Test", Pose(141, 125, 90), menu=18)
def draw_line_following_test() -> Pixels:
    """Draw eleven black lines of different kinds."""
    canvas = SmoothCanvas()
    for line in load_track_lines("line_following_test.json"):
        canvas.line(line.points, line.width)
    return canvas.to_pixels()


#: Default obstacles on Obstacles_Test.
_TEST_OBSTACLES: tuple[Obstacle, ...] = tuple(
    (x, y, 150, 150) for x, y in ((46, 388), (479, 704), (852, 388), (1374, 388), (1758, 900), (2126, 388))
)


@register_floor("Obstacles_Test", Pose(121, 125, 90), menu=25, obstacles=_TEST_OBSTACLES)
def draw_obstacles_test() -> Pixels:
    """Draw six lines that lead to obstacles, and a broad black band."""
    canvas = SmoothCanvas()
    lines = load_track_lines("obstacles_test.json")
    for line in lines:
        canvas.line(line.points, line.width)
    top, bottom = 63.0, 1097.0
    canvas.rectangle((1036, top, 1334, bottom), BLACK)
    return canvas.to_pixels()


@register_floor("Junction_Handling_Test", Pose(698, 130, 90), menu=19)
def draw_junction_handling_test() -> Pixels:
    """Draw a street grid with a roundabout and green markers that show where to turn.

    A marker is in the right or left corner of a crossing. The drawing is new, with the original's dimensions: lines 20
    wide, markers 25.
    """
    width, marker, green = 20.0, 25.0, (0, 179, 0)
    columns, rows = (238, 698, 1158, 1618, 2078), (150, 480, 810)
    start_row, roundabout, radius = 1097, (1618, 480), 120.0
    canvas = SmoothCanvas()
    for x in columns:
        canvas.line(((x, rows[0] - width / 2), (x, start_row)), width)
    for y in rows:
        canvas.line(((columns[0], y), (columns[-1], y)), width)
    canvas.disc(roundabout, radius, WHITE)
    canvas.ring(roundabout, radius, width, BLACK)
    sides = {"left": -1, "right": 1}
    for column, row, side in (
        (0, 1, "right"), (0, 2, "right"), (1, 0, "left"), (1, 1, "right"), (1, 2, "left"), (2, 0, "right"),
        (2, 2, "right"), (3, 2, "left"), (4, 1, "left"),
    ):  # fmt: skip
        inner_edge = columns[column] + sides[side] * width / 2
        outer_edge = inner_edge + sides[side] * marker
        bottom = rows[row] + width / 2  # behind the crossing, seen by a robot that comes from below
        canvas.rectangle((min(inner_edge, outer_edge), bottom, max(inner_edge, outer_edge), bottom + marker), green)
    return canvas.to_pixels()


@register_floor("Thruxton_Circuit", Pose(457, 242, 120), menu=22)
def draw_thruxton_circuit() -> Pixels:
    """Draw the closed loop with the grey start bar across it, and flags and chequers beside the bar."""
    canvas = SmoothCanvas()
    (track,) = load_track_lines("thruxton_circuit.json")
    canvas.line(track.points, track.width)
    for point in track.points:  # closes the loop, and fills the specks that Pillow leaves at bends
        canvas.disc(point, track.width / 2, BLACK)
    bar = LocalFrame(centre=(423.2, 847.9), turn=27.4)
    for middle in ((551, 785), (220, 955)):
        _draw_flag(canvas, middle)
    canvas.polygon(bar.map_rectangle(along=(-258 / 2, 258 / 2), across=(-25 / 2, 25 / 2)), make_grey(192))
    for start in (-200.0, 185.0):
        _draw_chequers(canvas, bar, start)
    return canvas.to_pixels()


@dataclass(frozen=True, slots=True)
class LocalFrame:
    """Local coordinate system on the image; ``turn`` is its angle in degrees anticlockwise."""

    centre: Point
    turn: float

    def map_point(self, along: float, across: float) -> Point:
        """Return the image point at distance ``along`` the first axis and ``across`` downwards from it, in pixels."""
        cosine, sine = math.cos(math.radians(self.turn)), math.sin(math.radians(self.turn))
        x, y = self.centre
        return (x + along * cosine + across * sine, y - along * sine + across * cosine)

    def map_rectangle(self, along: tuple[float, float], across: tuple[float, float]) -> tuple[Point, ...]:
        """Return the four corners of a rectangle, in order, given its ranges along and across the axis in pixels."""
        (start, end), (top, bottom) = along, across
        return (
            self.map_point(start, top),
            self.map_point(end, top),
            self.map_point(end, bottom),
            self.map_point(start, bottom),
        )


def _draw_chequers(canvas: SmoothCanvas, bar: LocalFrame, start: float) -> None:
    """Draw a strip with two rows of squares on the bar's axis, away from the track."""
    side, count = 12.5, 5
    for row in range(2):
        for column in range(row % 2, count, 2):
            left, top = start + column * side, (row - 1) * side
            canvas.polygon(bar.map_rectangle((left, left + side), (top, top + side)), BLACK)


def _draw_flag(canvas: SmoothCanvas, middle: Point) -> None:
    """Draw a red pennant centred at ``middle``, with its pole on the right."""
    width, height, pole = 24.0, 24.0, 4.0
    x, y = middle
    right, top = x + width / 2, y - height / 2
    canvas.polygon(((x - width / 2, y), (right, top), (right, top + height)), RED)
    canvas.rectangle((right, top, right + pole, top + 2 * height), BLACK)


@functools.lru_cache(maxsize=1)
def load_centrelines() -> Mapping[str, tuple[Point, ...]]:
    """Return all centrelines by name: ``Line_Following_Test/141`` ..., and ``Thruxton_Circuit`` (clockwise, closed)."""
    test = load_track_lines("line_following_test.json")
    centrelines = {
        f"Line_Following_Test/{name}": _orient_upwards(line) for name, line in zip(_TEST_LINES, test, strict=False)
    }
    (circuit,) = load_track_lines("thruxton_circuit.json")
    centrelines["Thruxton_Circuit"] = tuple((x, HEIGHT - y) for x, y in circuit.points)
    return MappingProxyType(centrelines)


def _orient_upwards(line: TrackLine) -> tuple[Point, ...]:
    """Return the line from its lower end, clipped at the floor's edge."""
    points = [(x, HEIGHT - y) for x, y in line.points]
    if points[0][1] > points[-1][1]:
        points.reverse()
    clipped_points: list[Point] = []
    for start, end in itertools.pairwise(points):
        clipped_points.append(start)
        if end[1] > HEIGHT:
            share = (HEIGHT - start[1]) / (end[1] - start[1])
            clipped_points.append((start[0] + share * (end[0] - start[0]), float(HEIGHT)))
            return tuple(clipped_points)
    return (*clipped_points, points[-1])
