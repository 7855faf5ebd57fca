"""Bounds on the mean score of a pool: simulated gradings of ten kinds of pools, and what is certain."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
import numpy.typing as npt
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from service.grading.pools.mean_bounds import bound_mean, find_plausible_means

ERROR = 0.05
SIZE = 200
Scores = npt.NDArray[np.float64]
POOLS: dict[str, Callable[[np.random.Generator], Scores]] = {
    "uniform": lambda chance: chance.random(SIZE),
    "around a quarter": lambda chance: chance.beta(10, 30, SIZE),
    "few passes": lambda chance: np.where(chance.random(SIZE) < 0.1, 1.0, 0.0),
    "half passes": lambda chance: np.where(chance.random(SIZE) < 0.5, 1.0, 0.0),
    "extremes": lambda chance: chance.beta(0.5, 0.5, SIZE),
    "constant": lambda chance: np.full(SIZE, 0.7),
    "nearly full": lambda chance: np.where(chance.random(SIZE) < 0.03, chance.random(SIZE), 1.0),
    "quarters": lambda chance: chance.integers(0, 5, SIZE) / 4,
    "low": lambda chance: chance.beta(1, 20, SIZE),
    "two groups": lambda chance: np.where(np.arange(SIZE) < SIZE // 3, 0.2, 0.9),
}


def share_of_wrong_bounds(make_pool: Callable[[np.random.Generator], Scores], gradings: int) -> float:
    """Return the share of gradings in which the true mean was rejected at any time before the end of the pool."""
    chance, wrong = np.random.default_rng(28), 0
    for _ in range(gradings):
        pool = chance.permutation(make_pool(chance))
        wrong += not find_plausible_means(np.array([pool.mean()]), SIZE, pool[:-1], ERROR)[0]
    return wrong / gradings


@pytest.mark.long
@pytest.mark.parametrize("name", POOLS)
@pytest.mark.parametrize("gradings", [40, pytest.param(1000, marks=pytest.mark.long)])
def test_bounds_are_wrong_less_often_than_declared(name: str, gradings: int) -> None:
    assert share_of_wrong_bounds(POOLS[name], gradings) <= ERROR


@settings(max_examples=30)
@given(st.lists(st.floats(0, 1), min_size=2, max_size=40), st.data())
def test_bounds_contain_what_is_certain(pool: list[float], data: st.DataObject) -> None:
    drawn = pool[: data.draw(st.integers(0, len(pool)))]
    bounds = bound_mean(len(pool), drawn, ERROR)
    certain_least = math.fsum(drawn) / len(pool)
    certain_most = certain_least + (len(pool) - len(drawn)) / len(pool)
    assert certain_least - 1e-9 <= bounds.least <= bounds.most <= certain_most + 1e-9
    if len(drawn) == len(pool):
        assert bounds.least == bounds.most == certain_least


def test_bounds_become_narrow() -> None:
    pool = np.random.default_rng(5).permutation(np.linspace(0.6, 0.8, SIZE)).tolist()
    widths = [bounds.most - bounds.least for bounds in (bound_mean(SIZE, pool[:drawn], ERROR) for drawn in (5, 20, 80))]
    assert widths == sorted(widths, reverse=True)
    assert widths[-1] < 0.1
