"""How a path runs along a line: for each moment where on the line it is, and how far from it.

Geometry only; what was asked of it is judged in ``line.py``.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from sim.recording import Floats
from submissions.criteria.places import LineToFollow

#: How far along the line, at least, the nearest point is looked for from one tick to the next, mm.
_WINDOW = 100.0


@dataclass(frozen=True, slots=True)
class Along:
    """For each row from ``first`` on: ``progress`` along the line (mm, growing beyond its length where it is closed)
    and ``offset`` from it (mm, to the left of its direction above 0)."""

    first: int
    progress: Floats
    offset: Floats
    length: float


def along(course: LineToFollow, points: Floats, within: float) -> Along | None:
    """How the path goes along the line from where it first comes ``within`` mm of it; None if it never does.

    From then on the nearest point is looked for only near the one before, so that a path that leaves the line and
    comes upon it again elsewhere, or crosses it, has not come any farther. A corner that is cut at d mm from the line
    on both sides makes the nearest point jump by twice that, so twice ``within`` is near enough.
    """
    line = _Line(course)
    distances = line.distances(points)
    near = np.flatnonzero(distances <= within)
    if not len(near):
        return None
    first = int(near[0])
    progress, offset = np.empty(len(points) - first), np.empty(len(points) - first)
    at, window = line.nearest(points[first]), max(_WINDOW, 2.2 * within)
    for row, (x, y) in enumerate(points[first:]):
        at, offset[row] = line.step(x, y, at, window)
        progress[row] = at
    return Along(first, progress, offset, line.length)


def covered(found: Along, within: float, begin: float, end: float) -> float:
    """The share of the line from ``begin`` to ``end`` that was driven forwards, ``within`` mm of it."""
    near = np.abs(found.offset) <= within
    pieces = []
    for before, after, is_near in zip(found.progress, found.progress[1:], near[:-1] & near[1:], strict=False):
        if is_near and after > before:
            pieces.append((max(float(before), begin), min(float(after), end)))
    reached, total = begin, 0.0
    for low, high in sorted(pieces):
        total += max(high - max(low, reached), 0.0)
        reached = max(reached, high)
    return total / (end - begin) if end > begin else 1.0


class _Line:
    """The stretches of a line, repeated endlessly if it is closed."""

    def __init__(self, course: LineToFollow) -> None:
        corners = np.array(course.corners())
        steps = np.diff(corners, axis=0)
        lengths = np.hypot(*steps.T)
        kept = lengths > 0
        self._starts, self._lengths = corners[:-1][kept], lengths[kept]
        self._directions = steps[kept] / self._lengths[:, None]
        self._begins = np.concatenate([[0.0], np.cumsum(self._lengths)[:-1]])
        self.length = float(self._lengths.sum())
        self._closed = course.is_closed

    def distances(self, points: Floats) -> Floats:
        return np.array([np.min(self._from(x, y)[1]) for x, y in points])

    def nearest(self, point: Floats) -> float:
        progress, distance, _ = self._from(float(point[0]), float(point[1]))
        return float(progress[int(np.argmin(distance))])

    def step(self, x: float, y: float, at: float, window: float) -> tuple[float, float]:
        """The nearest place within the window around ``at``, and the signed distance to it."""
        progress, distance, side = self._from(x, y)
        if self._closed:
            progress = at + (progress - at + self.length / 2) % self.length - self.length / 2
        allowed = np.abs(progress - at) <= window
        if not allowed.any():
            allowed = np.abs(progress - at) == np.min(np.abs(progress - at))
        best = int(np.argmin(np.where(allowed, distance, np.inf)))
        return float(progress[best]), float(np.copysign(distance[best], side[best]))

    def _from(self, x: float, y: float) -> tuple[Floats, Floats, Floats]:
        """For each stretch: the nearest place on it along the line, the distance to it, and the side (left above 0)."""
        away_x, away_y = x - self._starts[:, 0], y - self._starts[:, 1]
        forward_x, forward_y = self._directions[:, 0], self._directions[:, 1]
        ahead = np.clip(away_x * forward_x + away_y * forward_y, 0, self._lengths)
        side = forward_x * away_y - forward_y * away_x
        distance = np.hypot(away_x - ahead * forward_x, away_y - ahead * forward_y)
        return self._begins + ahead, distance, side
