"""Ranking of a batch by a measured value: ties, and the confidence interval of each value.

The judges decide what a value is worth. This module gives no marks.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from statistics import fmean, stdev

#: Student's t of a 95 % interval, by degrees of freedom from 1. Beyond the last entry, the interval is at most 4 % too
#: wide.
_T95 = (
    *(12.706, 4.303, 3.182, 2.776, 2.571, 2.447, 2.365, 2.306, 2.262, 2.228),
    *(2.201, 2.179, 2.160, 2.145, 2.131, 2.120, 2.110, 2.101, 2.093, 2.086),
    *(2.080, 2.074, 2.069, 2.064, 2.060, 2.056, 2.052, 2.048, 2.045, 2.042),
)


@dataclass(frozen=True, slots=True)
class StudentMeasures:
    """The measures of one student: the values of the trials that count, out of ``trials``."""

    student: str
    values: tuple[float, ...]
    trials: int


@dataclass(frozen=True, slots=True)
class RankRow:
    """A student's place, shared if the displayed values are equal; None without a trial that counts.

    ``value`` is the mean of the trials that count. ``low`` to ``high`` is its 95 % interval, for two trials or more.
    """

    place: int | None
    shared: bool
    measures: StudentMeasures
    value: float | None = None
    low: float | None = None
    high: float | None = None


@dataclass(frozen=True, slots=True)
class RankTable:
    """The students of a batch, ranked by one value, the best first."""

    assignment: str
    title: str
    measure: str
    unit: str
    rows: tuple[RankRow, ...]

    @property
    def texts(self) -> list[tuple[str, ...]]:
        """Place, student, value, interval and trials of each row, as tables show them."""
        return [_format_row(row) for row in self.rows]


def rank_students(measures: Sequence[StudentMeasures], *, highest: bool) -> tuple[RankRow, ...]:
    """Return the rows in order of place. Equal values share a place: 1, 2, 2, 4."""
    means = {each: round(fmean(each.values), 2) for each in measures if each.values}
    ranked_rows = [
        _build_row(
            each, 1 + sum((other > mean) if highest else (other < mean) for other in means.values()), mean, means
        )
        for each, mean in means.items()
    ]
    unranked_rows = [RankRow(None, False, each) for each in measures if not each.values]
    return (*sorted(ranked_rows, key=lambda row: (row.place, row.measures.student)), *unranked_rows)


def _build_row(measures: StudentMeasures, place: int, mean: float, means: dict[StudentMeasures, float]) -> RankRow:
    is_shared = list(means.values()).count(mean) > 1
    count = len(measures.values)
    if count < 2:
        return RankRow(place, is_shared, measures, mean)
    half_width = _T95[min(count - 1, len(_T95)) - 1] * stdev(measures.values) / math.sqrt(count)
    return RankRow(place, is_shared, measures, mean, mean - half_width, mean + half_width)


def _format_row(row: RankRow) -> tuple[str, ...]:
    place = "" if row.place is None else f"{row.place}{'=' if row.shared else ''}"
    value = "none" if row.value is None else f"{row.value:.2f}"
    interval = "" if row.low is None or row.high is None else f"{row.low:.2f} to {row.high:.2f}"
    return place, row.measures.student, value, interval, f"{len(row.measures.values)} of {row.measures.trials}"
