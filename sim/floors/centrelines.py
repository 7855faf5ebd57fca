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
    found = {
        f"Line_Following_Test/{name}": _orient_upwards(line) for name, line in zip(_TEST_LINES, test, strict=False)
    }
    (circuit,) = load_track_lines("thruxton_circuit.json")
    found["Thruxton_Circuit"] = tuple((x, HEIGHT - y) for x, y in circuit.points)
    return MappingProxyType(found)


def _orient_upwards(line: TrackLine) -> tuple[Point, ...]:
    """Return the line from its lower end, clipped at the floor's edge."""
    points = [(x, HEIGHT - y) for x, y in line.points]
    if points[0][1] > points[-1][1]:
        points.reverse()
    kept: list[Point] = []
    for before, after in itertools.pairwise(points):
        kept.append(before)
        if after[1] > HEIGHT:
            share = (HEIGHT - before[1]) / (after[1] - before[1])
            kept.append((before[0] + share * (after[0] - before[0]), float(HEIGHT)))
            return tuple(kept)
    return (*kept, points[-1])
