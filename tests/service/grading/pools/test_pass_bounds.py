"""Bounds on the passes of a pool: wrong decisions are computed exactly, for every number of passes."""

from __future__ import annotations

from dataclasses import dataclass
from fractions import Fraction
from math import ceil

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from service.grading.pools.pass_bounds import DrawnSample, PassBounds, bound_passes

ERROR = Fraction(1, 20)


@dataclass(frozen=True)
class Decisions:
    """By the number of passes in the pool: the probability of a wrong decision, and the mean number of trials."""

    wrong: np.ndarray
    trials: np.ndarray


def decide_exactly(size: int, boundary: float) -> Decisions:
    """Follow every order of every pool until the boundary is decided, by dynamic programming over the passes."""
    needed = ceil(round(boundary * size, 9))
    decided = np.zeros((size + 1, size + 1), int)
    for drawn in range(1, size + 1):
        for passes in range(drawn + 1):
            decided[drawn, passes] = decide(size, drawn, passes, needed)
    pool = np.arange(size + 1)
    passing = pool >= needed
    weights = np.zeros((size + 1, size + 1))
    weights[:, 0] = 1
    wrong, trials = np.zeros(size + 1), np.zeros(size + 1)
    for drawn in range(1, size + 1):
        chance = np.clip((pool[:, None] - np.arange(size + 1)) / (size - drawn + 1), 0, 1)
        trials += weights.sum(1)
        passed = weights * chance
        weights -= passed
        weights[:, 1:] += passed[:, :-1]
        for decision, is_wrong in ((1, ~passing), (-1, passing)):
            ended = decided[drawn] == decision
            wrong += np.where(is_wrong, weights[:, ended].sum(1), 0)
            weights[:, ended] = 0
    return Decisions(wrong, trials)


def decide(size: int, drawn: int, passes: int, needed: int) -> int:
    """Return 1 if all numbers of passes below ``needed`` are rejected, -1 if all others are, otherwise 0.

    The posterior has one maximum, so the most plausible number on each side decides.
    """
    sample, least, most = DrawnSample(size, drawn, passes, ERROR), passes, size - drawn + passes
    best = min(max(passes * (size + 1) // drawn, least), most)
    below, above = min(best, needed - 1), max(best, needed)
    has_below, has_above = below >= least and not sample.rejects(below), above <= most and not sample.rejects(above)
    return 0 if has_below == has_above else 1 if has_above else -1


@pytest.mark.parametrize(
    ("size", "boundary"),
    [
        (50, 0.5),
        (50, 0.7),
        (50, 0.9),
        (200, 0.7),
        (200, 0.5),
        (200, 0.9),
        pytest.param(1000, 0.7, marks=pytest.mark.long),
    ],
)
def test_wrong_decisions_are_rarer_than_declared(size: int, boundary: float) -> None:
    decisions = decide_exactly(size, boundary)
    assert decisions.wrong.max() <= float(ERROR)
    assert decisions.trials.max() < size
    if (size, boundary) == (200, 0.7):
        assert decisions.wrong.max() == pytest.approx(0.0231, abs=0.0005)
        clear = [*range(101), *range(180, 201)]
        assert decisions.trials[clear].min() >= 4
        assert decisions.trials[clear].max() == pytest.approx(36.3, abs=0.5)


@given(st.integers(2, 60), st.data())
def test_bounds_shrink_and_contain_what_is_certain(size: int, data: st.DataObject) -> None:
    outcomes = data.draw(st.lists(st.booleans(), min_size=size, max_size=size))
    before = PassBounds(0, size)
    for drawn in range(size + 1):
        bounds = bound_passes(size, outcomes[:drawn], ERROR)
        passes = sum(outcomes[:drawn])
        assert passes <= bounds.least <= bounds.most <= size - drawn + passes
        assert bounds.most - bounds.least <= before.most - before.least
        before = bounds
    assert before == PassBounds(sum(outcomes), sum(outcomes))


def test_first_bounds_of_one_sided_samples() -> None:
    # Computed by hand: with s = t = 3 and n = 10, m passes are rejected if C(11, 4) / (11 C(m, 3)) = 30 / C(m, 3) is at
    # least 20. So m = 3 is rejected, and m = 4 with 7.5 is not.
    assert bound_passes(10, [True] * 3, ERROR) == PassBounds(4, 10)
    assert bound_passes(10, [False] * 3, ERROR) == PassBounds(0, 6)
