"""Bounds on the passes of a pool: wrong decisions are computed exactly, for every number of passes."""

from __future__ import annotations

from fractions import Fraction

import pytest
from hypothesis import given
from hypothesis import strategies as st

from benchmarks.harness.pool_decisions import compute_fixed_number, decide_exactly
from service.grading.pools.pass_bounds import PassBounds, bound_passes

ERROR = Fraction(1, 20)


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
    decisions = decide_exactly(size, boundary, ERROR)
    assert decisions.wrong.max() <= float(ERROR)
    assert decisions.trials.max() < size
    if (size, boundary) == (200, 0.7):
        assert decisions.wrong.max() == pytest.approx(0.0231, abs=0.0005)
        clear = [*range(101), *range(180, 201)]
        assert decisions.trials[clear].min() >= 4
        assert decisions.trials[clear].max() == pytest.approx(36.3, abs=0.5)


def test_fixed_number_holds_on_both_sides_of_the_boundary() -> None:
    assert compute_fixed_number(10, 0.5, 10, 0.0) == 1
    # By hand, for 4 or 6 passes in 10: one trial is wrong with 0.4. Of two, one pass is enough, so 4 passes are decided
    # wrongly with 2/3. Of three, two are needed, which is wrong with 1/3 on both sides.
    assert compute_fixed_number(10, 0.5, 4, 0.41) == 1
    assert compute_fixed_number(10, 0.5, 6, 0.34) == 3
    # Nobody can tell 4 from 5 by fewer trials than all.
    assert compute_fixed_number(10, 0.5, 5, 0.05) == 10


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
