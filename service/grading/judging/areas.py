"""How far points are from an area of the floor: less than 0 inside, more than 0 outside.

Plain geometry; what follows from it is judged elsewhere.
"""

from __future__ import annotations

import numpy as np

from sim.recording import Floats
from submissions.criteria.places import Area


def distance_to(area: Area, points: Floats) -> Floats:
    """Signed distance of each point (n, 2) to the edge of the area, mm; a point on the edge has 0."""
    x, y = points[:, 0], points[:, 1]
    if area.circle is not None:
        return np.hypot(x - area.circle[0], y - area.circle[1]) - area.circle[2]
    if area.bar is not None:
        x1, y1, x2, y2, radius = area.bar
        return to_segment(points, (x1, y1), (x2, y2)) - radius
    corners: tuple[tuple[float, float], ...] = area.polygon or ()
    if area.rectangle is not None:
        left, bottom, right, top = area.rectangle
        corners = ((left, bottom), (right, bottom), (right, top), (left, top))
    edges = list(zip(corners, (*corners[1:], corners[0]), strict=True))
    nearest = np.min([to_segment(points, first, last) for first, last in edges], axis=0)
    within = np.zeros(len(points), dtype=bool)
    for (x1, y1), (x2, y2) in edges:  # a ray to the right crosses the outline an odd number of times from inside
        crosses = (y1 > y) != (y2 > y)
        if y1 != y2:
            within ^= crosses & (x < x1 + (y - y1) / (y2 - y1) * (x2 - x1))
    signed: Floats = np.where(within, -nearest, nearest)
    return signed


def to_segment(points: Floats, first: tuple[float, float], last: tuple[float, float]) -> Floats:
    """Distance of each point (n, 2) to the stretch between two points, mm."""
    start, along = np.array(first), np.array(last) - np.array(first)
    length = float(along @ along)
    share = np.clip((points - start) @ along / length, 0, 1) if length > 0 else np.zeros(len(points))
    away = points - start - share[:, None] * along
    distances: Floats = np.hypot(away[:, 0], away[:, 1])
    return distances
