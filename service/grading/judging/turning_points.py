"""The points at which a motion out and back changes its direction."""

from __future__ import annotations

import math
from dataclasses import dataclass

from sim.recording import Floats

#: The smallest height of a turning point above the path around it, mm.
_MIN_MOTION = 5.0


@dataclass(frozen=True, slots=True)
class TurningPoint:
    """A change from going out to coming back (``is_outward``), or the reverse."""

    row: int
    is_outward: bool


def find_turning_points(forward_distances: Floats) -> list[TurningPoint]:
    """Return peaks and returns alternately, beginning with the first way out, ending with the last row.

    A change of direction counts from 5 mm on. A last way out without a return ends in a peak.
    """
    turns: list[TurningPoint] = []
    sign = 0.0  # the side of the current excursion, 0 before the first
    extreme, is_outward = 0, True
    for row, value in enumerate(forward_distances):
        if not sign:
            if abs(value) >= _MIN_MOTION:
                sign, extreme = math.copysign(1, value), row
            continue
        extent, best_extent = sign * float(value), sign * float(forward_distances[extreme])
        if (extent > best_extent) if is_outward else (extent < best_extent):
            extreme = row
        elif abs(extent - best_extent) >= _MIN_MOTION:
            turns.append(TurningPoint(extreme, is_outward))
            is_outward, extreme = not is_outward, row
    if sign:
        turns.append(TurningPoint(extreme, is_outward))
    return turns
