"""Recordings built from moves, for tests of how motion and paths are judged."""

from __future__ import annotations

import math
from collections.abc import Sequence
from decimal import Decimal
from typing import Any

import numpy as np

from judging import START, judged
from service.grading.grade import CriterionResult, Measure
from sim.recording import Pose, Recording, Ticks, Verdict
from submissions.criteria import Criterion

#: Millimetres and degrees for each tick, and the number of ticks.
Move = tuple[float, float, int]


def straight(mm: float, per_tick: float = 5.0) -> Move:
    return math.copysign(per_tick, mm), 0.0, round(abs(mm) / per_tick)


def spin(degrees: float, per_tick: float = 3.0) -> Move:
    return 0.0, math.copysign(per_tick, degrees), round(abs(degrees) / per_tick)


def rest(ticks: int = 4) -> Move:
    return 0.0, 0.0, ticks


def driven(*moves: Move, start: Pose = START, rgb: Sequence[Sequence[float]] = (), **parts: Any) -> Recording:
    """Integrate these moves as the course does; ``rgb`` is the left sensor's reading, one row a tick."""
    steps = [(ahead, turned) for ahead, turned, count in moves for _ in range(count)]
    x, y, heading = [start.x], [start.y], [start.heading]
    for ahead, turned in steps:
        x.append(x[-1] + ahead * math.cos(math.radians(heading[-1])))
        y.append(y[-1] + ahead * math.sin(math.radians(heading[-1])))
        heading.append(heading[-1] + turned)
    return along(np.column_stack([x, y]), np.array(heading), rgb, start=start, **parts)


def along(points: np.ndarray, heading: np.ndarray, rgb: Sequence[Sequence[float]] = (), **parts: Any) -> Recording:
    """Return a run through these points, shape (n + 1, 2), beginning with the start."""
    count = len(points) - 1
    white = np.full((count, 3), 255 * 305, dtype=np.int64)
    left = np.array(rgb, dtype=np.int64).reshape(-1, 3) * 305 if len(rgb) else white
    travelled = np.concatenate([[0], np.hypot(*np.diff(points, axis=0).T)]).cumsum()[1:]
    wheel = travelled / (math.pi * 56) * 360
    values: dict[str, Any] = {
        "background": "Empty_Map",
        "start": Pose(float(points[0, 0]), float(points[0, 1]), float(heading[0])),
        "end": Pose(float(points[-1, 0]), float(points[-1, 1]), float(heading[-1])),
        "end_t": count / 30,
        "ticks": Ticks(
            points[1:, 0], points[1:, 1], heading[1:], wheel, wheel, left, white, np.zeros(count), -heading[1:]
        ),
        "verdict": Verdict.FINISHED,
        "sha256": "0" * 64,
        "pen": ((0, True),),
    }
    return Recording(**(values | parts))


def passes(criterion: Criterion, recording: Recording) -> bool:
    """Return whether the recording gets full marks."""
    result = judged(criterion, recording)
    assert result.evidence[0].passed == (result.marks == Decimal(4)), result.message
    return result.evidence[0].passed


def measured(result: CriterionResult, name: str) -> float:
    """Return the measure of this name in the first trial."""
    matching_measure: Measure = next(measure for measure in result.evidence[0].measures if measure.name == name)
    return matching_measure.value
