"""Bounds on the number of passing trials in a pool, from the trials drawn so far without replacement.

The bounds are valid at every stop: however the moment is chosen to stop drawing, they are wrong with at most the
declared probability.

The confidence sequence is the prior-posterior ratio of Waudby-Smith and Ramdas, "Confidence sequences for sampling
without replacement" (NeurIPS 2020, arXiv 2006.04347, theorem 2.1) with a uniform prior. With ``s`` passes in ``t`` of
``n`` trials, the posterior of ``m`` passes in the pool is C(m, s) C(n - m, t - s) / C(n + 1, t + 1). A number is
rejected as soon as its prior is at least 1/error times its posterior. All arithmetic is exact.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction
from itertools import accumulate
from math import comb


@dataclass(frozen=True, slots=True)
class PassBounds:
    """The least and the most passes that the whole pool can have, both included."""

    least: int
    most: int


def bound_passes(size: int, outcomes: Sequence[bool], error: Fraction) -> PassBounds:
    """Return the bounds after these outcomes. They are equal once every trial was drawn.

    Args:
        size: The number of trials of the pool.
        outcomes: Whether each drawn trial passed, in the order of drawing; at most ``size``.
        error: The probability, over the order of the pool, that the bounds are ever wrong; between 0 and 1.
    """
    least, most = 0, size
    for drawn, passes in enumerate(accumulate(outcomes), 1):
        sample = DrawnSample(size, drawn, passes, error)
        # Those that are left are neighbours, because the posterior has one maximum. With less than the declared error,
        # none would be left; then the last one stays.
        while least < most and sample.rejects(least):
            least += 1
        while least < most and sample.rejects(most):
            most -= 1
    certain_least = sum(outcomes)
    certain_most = size - len(outcomes) + certain_least
    return PassBounds(min(max(least, certain_least), certain_most), max(min(most, certain_most), certain_least))


@dataclass(frozen=True, slots=True)
class DrawnSample:
    """The first ``drawn`` trials of a pool, of which ``passes`` passed."""

    size: int
    drawn: int
    passes: int
    error: Fraction

    def rejects(self, pool_passes: int) -> bool:
        """Return whether the pool cannot have this number of passes, or only with the probability of the error."""
        ways = comb(pool_passes, self.passes) * comb(self.size - pool_passes, self.drawn - self.passes)
        all_ways = comb(self.size + 1, self.drawn + 1)
        return all_ways * self.error.numerator >= self.error.denominator * (self.size + 1) * ways
