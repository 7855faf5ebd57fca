"""Paths of SVG documents: their data in whole units, and lines without the points that nobody would see."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from matplotlib.path import Path

from service.reports.plots.drawing import Points

#: Units per inch.
UNITS = 1000
_PIXELS = 200  # per inch, for the tolerance
_TOLERANCE = 0.25  # pixels that a simplified line may differ
_COLUMNS = 100  # per inch, of a curve over time; more readings in a column are drawn as their range


def write_path(points: Points) -> str:
    """Return the data of a path: its first point, then steps between whole units."""
    whole_points = np.rint(points[np.isfinite(points).all(axis=1)]).astype(np.int64)
    if len(whole_points) < 2:
        return ""
    steps = np.diff(whole_points, axis=0)
    steps = steps[steps.any(axis=1)]
    numbers = " ".join(f"{x} {y}" for x, y in steps.tolist()).replace(" -", "-")
    return f"M{whole_points[0, 0]} {whole_points[0, 1]}" + (f"l{numbers}" if len(steps) else "h0")


def write_circle(x: float, y: float, radius: float) -> str:
    """Return the data of a circle."""
    r = round(radius)
    return f"M{round(x) - r} {round(y)}a{r} {r} 0 1 0 {2 * r} 0a{r} {r} 0 1 0-{2 * r} 0z"


def simplify_line(points: Points) -> Iterator[Points]:
    """Yield the parts of a line between its gaps (NaN), with fewer points that look the same."""
    if _is_series(points):
        yield from _split_at_gaps(_reduce_series(points))
        return
    for run in _split_at_gaps(points):
        yield _simplify(run)


def _is_series(points: Points) -> bool:
    """Return whether the points are a curve from left to right with more readings than the page can show."""
    if len(points) < 2 or not np.isfinite(points[:, 0]).all():
        return False
    width = float(np.ptp(points[:, 0]))
    return bool((np.diff(points[:, 0]) >= 0).all()) and len(points) > 4 * width * _COLUMNS / UNITS


def _reduce_series(points: Points) -> Points:
    """Return the first, lowest, highest and last reading of each column, in order. Gaps (NaN) stay."""
    columns = (points[:, 0] * _COLUMNS / UNITS).astype(np.int64)
    values = points[:, 1]
    is_start = np.concatenate(([True], (np.diff(columns) > 0) | (np.diff(~np.isfinite(values)) != 0)))
    starts = np.flatnonzero(is_start)
    ends = np.append(starts[1:], len(points)) - 1
    ascending_rows = np.lexsort((values, np.cumsum(is_start)))
    rows = np.unique(np.concatenate((starts, ascending_rows[starts], ascending_rows[ends], ends)))
    kept_points: Points = points[rows]
    return kept_points


def _split_at_gaps(points: Points) -> Iterator[Points]:
    """Yield the runs of finite points."""
    is_finite = np.isfinite(points).all(axis=1)
    edges = np.flatnonzero(np.diff(np.concatenate(([False], is_finite, [False])).astype(np.int8)))
    for start, end in edges.reshape(-1, 2).tolist():
        yield points[start:end]


def _simplify(points: Points) -> Points:
    """Return the points without those that change the line by less than the tolerance."""
    if len(points) < 3:
        return points
    path = Path(points * (_PIXELS / UNITS))
    path.should_simplify, path.simplify_threshold = True, _TOLERANCE
    simplified_path = path.cleaned(simplify=True)
    is_point = simplified_path.codes != Path.STOP
    vertices: Points = np.asarray(simplified_path.vertices, np.float64)[is_point]
    return vertices * (UNITS / _PIXELS)
