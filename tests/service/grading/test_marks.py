"""Marks for an outcome: shares, steps, several trials, and rounding."""

from __future__ import annotations

from decimal import Decimal
from fractions import Fraction

import pytest
from hypothesis import given
from hypothesis import strategies as st

from judging import criterion, judged, recorded, talk
from service.grading.judging.answers import is_same_value
from service.grading.judging.marks import Over, combine_outcomes, compute_accuracy_share, compute_marks
from service.grading.judging.outcome import Outcome

outcomes = st.lists(
    st.one_of(
        st.just(Outcome(True, Fraction(1), "")),
        st.fractions(0, Fraction(6, 7), max_denominator=7).map(lambda score: Outcome(False, score, "")),
    ),
    min_size=1,
    max_size=12,
)
marks = st.decimals(0, 100, places=2)
overs: st.SearchStrategy[Over] = st.sampled_from(("share", "all", "mean", "median", "worst"))


@given(marks, outcomes, overs)
def test_marks_are_within_bounds_and_full_exactly_for_a_full_share(
    full: Decimal, trial_outcomes: list[Outcome], over: Over
) -> None:
    share = combine_outcomes(trial_outcomes, over)
    got = compute_marks(full, share)
    assert 0 <= got <= full
    assert got == got.quantize(Decimal("0.01"))
    if all(outcome.passed for outcome in trial_outcomes):
        assert got == full
    if over in ("all", "worst", "share", "mean") and not all(outcome.passed for outcome in trial_outcomes):
        assert share < 1


@given(marks, outcomes, overs, st.data())
def test_passing_one_more_trial_never_costs_marks(
    full: Decimal, trial_outcomes: list[Outcome], over: Over, data: st.DataObject
) -> None:
    place = data.draw(st.integers(0, len(trial_outcomes) - 1))
    better = [*trial_outcomes]
    better[place] = Outcome(True, Fraction(1), "")
    assert compute_marks(full, combine_outcomes(better, over)) >= compute_marks(
        full, combine_outcomes(trial_outcomes, over)
    )


@given(marks, st.integers(0, 60), st.integers(1, 60), st.none() | st.floats(0.01, 1), st.sampled_from(("share", "all")))
def test_a_better_accuracy_never_costs_marks(
    full: Decimal, right: int, count: int, at_least: float | None, over: Over
) -> None:
    right = min(right, count)
    got = compute_marks(full, compute_accuracy_share(right, count, at_least, over))
    assert 0 <= got <= full
    assert compute_marks(full, compute_accuracy_share(min(right + 1, count), count, at_least, over)) >= got
    if right == count or (at_least is not None and right / count >= at_least + 1e-9):
        assert got == full


@pytest.mark.parametrize(
    ("full", "share", "got"),
    [
        ("1", Fraction(1, 3), "0.33"),
        ("1", Fraction(2, 3), "0.67"),
        ("0.01", Fraction(1, 2), "0.01"),
        ("0.05", Fraction(1, 2), "0.03"),
        ("2.5", Fraction(1, 4), "0.63"),
        ("0.1", Fraction(1, 2), "0.05"),
        ("10000", Fraction(1, 3), "3333.33"),
    ],
)
def test_marks_are_rounded_half_up_once(full: str, share: Fraction, got: str) -> None:
    assert compute_marks(Decimal(full), share) == Decimal(got)


def test_nine_of_ten_is_at_least_nine_tenths() -> None:
    assert compute_accuracy_share(9, 10, 0.9, "share") == 1
    assert compute_accuracy_share(8, 10, 0.9, "share") == Fraction(8, 9)
    assert compute_accuracy_share(8, 10, 0.9, "all") == 0


def test_a_run_of_very_many_messages_is_judged_like_a_short_one() -> None:
    count = 20_000
    messages = talk(*[("PY::1", 'JSON::{"message": 1}')] * count)
    queue = judged(criterion("messages", queue_grows=True), recorded(messages=messages))
    assert queue.message == f"The robot's queue grew by one for each of {count} messages."
    answered = judged(criterion("replies", expect={"PY::1": 1}, path="message"), recorded(messages=messages))
    assert answered.marks == 4


@pytest.mark.parametrize(("actual", "expected"), [(10**400, 0.5), (-(10**400), 1.0), (float("inf"), 10**400)])
def test_numbers_beyond_all_fractions_are_compared(actual: float, expected: float) -> None:
    assert not is_same_value(actual, expected)
