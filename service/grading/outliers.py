"""Submissions of a class that somebody should look at: far below the others, far slower, or close to the pass mark.

A pure function of marks and times that are there already; it judges nothing.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from decimal import Decimal
from statistics import fmean, median, pstdev
from typing import Literal

#: Of fewer nobody is unlike the others.
_FEWEST = 8
_SPREADS_BELOW = 2.0
_TIMES_SLOWER, _SECONDS_SLOWER = 3.0, 5.0
#: How far from the pass mark is close, of all marks.
_CLOSE = Decimal("0.05")


@dataclass(frozen=True, slots=True)
class MarksAndTime:
    """What one submission got, 0 to 1, and how many seconds its grading took, where it was run."""

    id: str
    share: Decimal
    seconds: float | None


@dataclass(frozen=True, slots=True)
class Outlier:
    """One to be looked at, and why."""

    id: str
    why: Literal["low", "slow", "close"]


def outliers(found: Sequence[MarksAndTime], pass_share: Decimal) -> tuple[Outlier, ...]:
    """The lowest, then the slowest, then those on either side of the pass mark."""
    return (*_low(found), *_slow(found), *_close(found, pass_share))


def _low(found: Sequence[MarksAndTime]) -> Iterator[Outlier]:
    shares = [float(each.share) for each in found]
    if len(found) < _FEWEST or not (spread := pstdev(shares)):
        return
    below = fmean(shares) - _SPREADS_BELOW * spread
    for each in sorted(found, key=lambda each: each.share):
        if each.share < below:
            yield Outlier(each.id, "low")


def _slow(found: Sequence[MarksAndTime]) -> Iterator[Outlier]:
    times = {each.id: each.seconds for each in found if each.seconds is not None}
    if len(times) < _FEWEST:
        return
    usual = median(times.values())
    longest = max(_TIMES_SLOWER * usual, usual + _SECONDS_SLOWER)
    for own, seconds in sorted(times.items(), key=lambda item: -item[1]):
        if seconds > longest:
            yield Outlier(own, "slow")


def _close(found: Sequence[MarksAndTime], pass_share: Decimal) -> Iterator[Outlier]:
    for each in sorted(found, key=lambda each: each.share):
        if abs(each.share - pass_share) <= _CLOSE:
            yield Outlier(each.id, "close")
