"""One line of the table, and the way CPU time is taken."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Measurement:
    """What was measured, beside what it should be."""

    what: str
    measured: str
    budget: str
    beyond: str = ""


def median_of(count: int, measure: Callable[[], float]) -> float:
    """The middle one of ``count`` measurements, after one that only warms up."""
    measure()
    return sorted(measure() for _ in range(count))[count // 2]


def cpu_seconds(work: Callable[[], object]) -> float:
    """CPU seconds of this process."""
    start = time.process_time()
    work()
    return time.process_time() - start
