"""Submissions in a class that need review: far below the others, far slower, or close to the pass mark.

A pure function of existing marks and times. It does not judge anything.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from decimal import Decimal
from statistics import fmean, median, pstdev
from typing import Literal

#: The smallest class with outliers.
_MIN_SUBMISSIONS = 8
_SPREADS_BELOW = 2.0
_TIMES_SLOWER, _SECONDS_SLOWER = 3.0, 5.0
#: The distance from the pass mark that counts as close, as a fraction of all marks.
_CLOSE_SHARE = Decimal("0.05")


@dataclass(frozen=True, slots=True)
class MarksAndTime:
    """The marks of one submission (0 to 1) and the seconds its grading took, if it ran."""

    id: str
    share: Decimal
    seconds: float | None


@dataclass(frozen=True, slots=True)
class Outlier:
    """A submission that needs review, with the reason."""

    id: str
    why: Literal["low", "slow", "close"]


def find_outliers(submissions: Sequence[MarksAndTime], pass_share: Decimal) -> tuple[Outlier, ...]:
    """Return the lowest, then the slowest, then those on either side of the pass mark."""
    return (*_find_lowest(submissions), *_find_slowest(submissions), *_find_borderline(submissions, pass_share))


def _find_lowest(submissions: Sequence[MarksAndTime]) -> Iterator[Outlier]:
    shares = [float(each.share) for each in submissions]
    if len(submissions) < _MIN_SUBMISSIONS or not (spread := pstdev(shares)):
        return
    limit = fmean(shares) - _SPREADS_BELOW * spread
    for submission in sorted(submissions, key=lambda each: each.share):
        if submission.share < limit:
            yield Outlier(submission.id, "low")


def _find_slowest(submissions: Sequence[MarksAndTime]) -> Iterator[Outlier]:
    times = {each.id: each.seconds for each in submissions if each.seconds is not None}
    if len(times) < _MIN_SUBMISSIONS:
        return
    median_seconds = median(times.values())
    longest = max(_TIMES_SLOWER * median_seconds, median_seconds + _SECONDS_SLOWER)
    for submission_id, seconds in sorted(times.items(), key=lambda item: -item[1]):
        if seconds > longest:
            yield Outlier(submission_id, "slow")


def _find_borderline(submissions: Sequence[MarksAndTime], pass_share: Decimal) -> Iterator[Outlier]:
    for submission in sorted(submissions, key=lambda each: each.share):
        if abs(submission.share - pass_share) <= _CLOSE_SHARE:
            yield Outlier(submission.id, "close")
