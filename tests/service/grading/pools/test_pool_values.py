"""Values of criteria over a pool: which marks are decided, by rule and bands."""

from __future__ import annotations

from decimal import Decimal
from fractions import Fraction

import pytest

from service.grading.grade import PoolValue
from service.grading.judging.judge import JUDGES
from service.grading.judging.outcome import Outcome
from service.grading.pools.pool_sentences import describe_for_staff, describe_for_students
from service.grading.pools.pool_values import compute_pool_share
from submissions.criteria import SCHEMAS
from submissions.criteria.ending import Finishes

ERROR = Fraction(1, 20)
BANDS = ((0.5, 2.0), (0.8, 4.0))


def finishes(over: str, bands: tuple[tuple[float, float], ...] = ()) -> Finishes:
    return Finishes.model_validate(
        {"check": "finishes", "title": "Ends", "marks": Decimal(4), "over": over, "bands": bands}
    )


def outcomes(scores: str) -> list[Outcome]:
    """Return one outcome per character: ``+`` passed, ``-`` failed, a digit failed with that tenth of the score."""
    return [
        Outcome(each == "+", Fraction(1) if each == "+" else Fraction(int(each.replace("-", "0")), 10), "")
        for each in scores
    ]


@pytest.mark.parametrize(
    ("over", "bands", "drawn", "size", "share", "is_decided"),
    [
        ("share", (), "+-+-", 4, Fraction(1, 2), True),
        ("share", (), "+++-", 200, Fraction(3, 4), False),
        ("share", BANDS, "+" * 40, 200, Fraction(1), True),
        ("share", BANDS, "-" * 12, 200, Fraction(0), True),
        ("share", BANDS, "+++-", 200, Fraction(1, 2), False),
        ("share", BANDS, "++-+" * 50, 200, Fraction(1, 2), True),
        ("mean", BANDS, "9" * 60, 200, Fraction(1), True),
        ("mean", (), "5" * 10, 10, Fraction(1, 2), True),
        ("all", (), "++-", 200, Fraction(0), True),
        ("all", (), "+" * 199, 200, Fraction(1), False),
        ("all", (), "+" * 200, 200, Fraction(1), True),
        ("worst", (), "+0", 200, Fraction(0), True),
        ("worst", (), "+4", 200, Fraction(2, 5), False),
        ("median", (), "+" * 101, 200, Fraction(1), True),
        ("median", (), "+" * 99, 200, Fraction(1), False),
    ],
)
def test_marks_are_decided_when_all_values_within_the_bounds_give_the_same(
    over: str, bands: tuple[tuple[float, float], ...], drawn: str, size: int, share: Fraction, is_decided: bool
) -> None:
    actual_share, value = compute_pool_share(finishes(over, bands), outcomes(drawn), size, ERROR)
    assert (actual_share, value.is_decided, value.drawn) == (share, is_decided, len(drawn))
    assert 0 <= value.least <= value.most <= 1
    assert value.is_exact is (len(drawn) == size)


def test_students_see_no_exact_share_of_hidden_trials() -> None:
    value = PoolValue(200, 23, 0.623, 0.861, False)
    note = describe_for_staff(value, "share").note
    assert "23 of 200 trials" in note
    assert "62 to 87 % of all trials" in note
    public = describe_for_students(value, "share")
    assert (public.drawn, public.least, public.most, public.is_exact) == (0, 0.6, 0.9, False)
    assert "60 to 90 % of all trials" in public.note
    assert "23 of" not in public.note
    exact = describe_for_students(PoolValue(200, 200, 0.623, 0.623, True), "share")
    assert (exact.least, exact.most, exact.is_exact) == (0.6, 0.65, True)
    assert "all 200 trials" not in exact.note


def test_criteria_that_judge_each_trial_can_have_a_pool() -> None:
    by_trial = {
        name for name, schema in SCHEMAS.items() if JUDGES[schema].judge.__qualname__.startswith("declare_judge.")
    }
    declared = {name for name, schema in SCHEMAS.items() if schema.judges_runs and schema.judges_each_trial}
    assert by_trial <= declared
    assert declared - by_trial == {"spread", "ranking"}  # judged by trial; a ranking needs another result
