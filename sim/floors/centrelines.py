"""Named centrelines of the tracks, in their driving direction.

Coordinates are world coordinates (mm, y up), clipped at the floor's edges. ``tracks.py`` draws the lines.
"""

from __future__ import annotations

import functools
import itertools
from collections.abc import Mapping
from types import MappingProxyType

from sim.floors.canvas import HEIGHT, Point
from sim.floors.tracks import TrackLine, load_track_lines

#: The lines of Line_Following_Test in the order of the data file. Each name is the x where the line starts, with
#: ``high`` for lines that start half-way up. The broken line with its three parts is not included.
_TEST_LINES = ("141", "440", "771", "1076", "1453-high", "1453", "1821", "1821-high")


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
