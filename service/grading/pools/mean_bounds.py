"""Bounds on the mean score of a pool, from the scores of the trials drawn so far without replacement.

The bounds are valid at every stop, as those of ``pass_bounds``.

The confidence sequence is the hedged capital process for sampling without replacement of Waudby-Smith and Ramdas,
"Estimating means of bounded random variables by betting" (JRSS B 2024, arXiv 2010.09686): section 5, with the
predictable plug-in bets of section 4.1. For each possible mean there are two gamblers, who bet that the pool's mean is
higher, and that it is lower. A mean is rejected once half the capital of one of them is at least 1/error.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

#: Possible means are examined at this distance. The bounds include the neighbours of those that are not rejected.
_STEP = 1 / 2000
#: The part of the capital that a bet may lose at most; the paper recommends 1/2 or 3/4.
_MAX_LOSS = 0.5
#: More than the rounding errors of a mean.
_ROUNDING = 1e-9


@dataclass(frozen=True, slots=True)
class MeanBounds:
    """The least and the greatest mean, from 0 to 1, that the whole pool can have."""

    least: float
    most: float


def bound_mean(size: int, scores: Sequence[float], error: float) -> MeanBounds:
    """Return the bounds after these scores. They are equal once every trial was drawn.

    Args:
        size: The number of trials of the pool.
        scores: The scores of the drawn trials, from 0 to 1, in the order of drawing; at most ``size``.
        error: The probability, over the order of the pool, that the bounds are ever wrong; between 0 and 1.
    """
    total = math.fsum(scores)
    possible_least, possible_most = total / size, (total + size - len(scores)) / size
    if len(scores) == size:
        return MeanBounds(possible_least, possible_least)
    means = np.linspace(0.0, 1.0, round(1 / _STEP) + 1)
    kept_means = means[find_plausible_means(means, size, np.asarray(scores, float), error)]
    if not len(kept_means):  # happens with less than the declared error
        return MeanBounds(possible_least, possible_most)
    return MeanBounds(max(possible_least, kept_means[0] - _STEP), min(possible_most, kept_means[-1] + _STEP))


def find_plausible_means(
    means: np.ndarray[tuple[int], np.dtype[np.float64]],
    size: int,
    scores: np.ndarray[tuple[int], np.dtype[np.float64]],
    error: float,
) -> np.ndarray[tuple[int], np.dtype[np.bool_]]:
    """Return which of these means were rejected at no time."""
    is_plausible = np.ones(len(means), bool)
    high_capital, low_capital = np.ones(len(means)), np.ones(len(means))
    drawn_sum, running_mean, variance_sum = 0.0, 0.5, 0.25
    for number, score in enumerate(scores, 1):
        # The mean of the trials that are left, if the pool had this mean.
        left_mean = (size * means - drawn_sum) / (size - number + 1)
        is_plausible &= (left_mean > -_ROUNDING) & (left_mean < 1 + _ROUNDING)
        left_mean = np.clip(left_mean, _ROUNDING, 1 - _ROUNDING)
        variance = variance_sum / number
        bet = math.sqrt(2 * math.log(2 / error) / (variance * number * math.log(number + 1)))
        surprise = score - left_mean
        high_capital *= 1 + np.minimum(bet, _MAX_LOSS / left_mean) * surprise
        low_capital *= 1 - np.minimum(bet, _MAX_LOSS / (1 - left_mean)) * surprise
        is_plausible &= np.maximum(high_capital, low_capital) < 2 / error
        drawn_sum += score
        running_mean = (0.5 + drawn_sum) / (number + 1)
        variance_sum += (score - running_mean) ** 2
    return is_plausible
