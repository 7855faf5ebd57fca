"""Exact probabilities of decisions about a pool, by the rule of ``pass_bounds`` and by a fixed number of trials."""

from __future__ import annotations

from dataclasses import dataclass
from fractions import Fraction
from math import ceil

import numpy as np
import numpy.typing as npt

from service.grading.pools.pass_bounds import DrawnSample


@dataclass(frozen=True)
class Decisions:
    """By the number of passes in the pool: the probability of a wrong decision, and the mean number of trials."""

    wrong: npt.NDArray[np.float64]
    trials: npt.NDArray[np.float64]


def count_needed(number: int, boundary: float) -> int:
    """Return the least number of passes of ``number`` trials that reaches the boundary."""
    return ceil(round(boundary * number, 9))


def decide_exactly(size: int, boundary: float, error: Fraction) -> Decisions:
    """Follow every order of every pool until the boundary is decided, by dynamic programming over the passes."""
    needed = count_needed(size, boundary)
    decided = np.zeros((size + 1, size + 1), int)
    for drawn in range(1, size + 1):
        for passes in range(drawn + 1):
            decided[drawn, passes] = _decide(DrawnSample(size, drawn, passes, error), needed)
    pool = np.arange(size + 1)
    passing = pool >= needed
    weights = np.zeros((size + 1, size + 1))
    weights[:, 0] = 1
    wrong, trials = np.zeros(size + 1), np.zeros(size + 1)
    for drawn in range(1, size + 1):
        trials += weights.sum(1)
        weights = _draw_one(weights, pool, size - drawn + 1)
        for decision, is_wrong in ((1, ~passing), (-1, passing)):
            ended = decided[drawn] == decision
            wrong += np.where(is_wrong, weights[:, ended].sum(1), 0)
            weights[:, ended] = 0
    return Decisions(wrong, trials)


def _decide(sample: DrawnSample, needed: int) -> int:
    """Return 1 if all numbers of passes below ``needed`` are rejected, -1 if all others are, otherwise 0.

    The posterior has one maximum, so the most plausible number on each side decides.
    """
    least, most = sample.passes, sample.size - sample.drawn + sample.passes
    best = min(max(sample.passes * (sample.size + 1) // sample.drawn, least), most)
    below, above = min(best, needed - 1), max(best, needed)
    has_below, has_above = below >= least and not sample.rejects(below), above <= most and not sample.rejects(above)
    return 0 if has_below == has_above else 1 if has_above else -1


def compute_fixed_number(size: int, boundary: float, passes: int, error: float) -> int:
    """Return how many trials decide a pool by the share of them that passes, if their number is fixed before.

    This is the smallest number for which the decision is wrong with at most this probability for every pool that is
    at least as far from the boundary, on both sides of it.

    Args:
        size: The number of trials of the pool.
        boundary: The share of passes from which the decision is positive.
        passes: The number of passing trials in the pool.
        error: The greatest probability of a wrong decision.
    """
    # Farther pools are decided wrongly less often, so the nearest one on each side is enough.
    distance = abs(Fraction(passes, size) - Fraction(str(boundary)))
    far_pools = [each for each in range(size + 1) if abs(Fraction(each, size) - Fraction(str(boundary))) >= distance]
    needed = count_needed(size, boundary)
    nearest_below = [each for each in far_pools if each < needed][-1:]
    nearest_above = [each for each in far_pools if each >= needed][:1]
    weights = np.zeros((len(nearest_below) + len(nearest_above), size + 1))
    weights[:, 0] = 1
    is_below = np.arange(len(weights)) < len(nearest_below)
    pools = np.array(nearest_below + nearest_above)
    for number in range(1, size):
        weights = _draw_one(weights, pools, size - number + 1)
        reached = weights[:, count_needed(number, boundary) :].sum(1)
        if np.where(is_below, reached, 1 - reached).max() <= error:
            return number
    return size


def _draw_one(weights: npt.NDArray[np.float64], pools: npt.NDArray[np.int_], left: int) -> npt.NDArray[np.float64]:
    """Return the probabilities of each number of passes after one more trial, of ``left`` that are not drawn yet."""
    chance = np.clip((pools[:, None] - np.arange(weights.shape[1])) / left, 0, 1)
    passed = weights * chance
    failed = weights - passed
    failed[:, 1:] += passed[:, :-1]
    return failed
