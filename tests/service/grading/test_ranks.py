"""Places across a batch: ties, the mean of a student's trials, and its interval."""

from __future__ import annotations

import pytest

from service.grading.ranks import RankTable, StudentMeasures, rank_students


def places(*values: tuple[float, ...], highest: bool = False) -> list[tuple[str, str]]:
    measures = [StudentMeasures(name, own, 3) for name, own in zip("abcdef", values, strict=False)]
    table = RankTable("a", "T", "lap time", "s", rank_students(measures, highest=highest))
    return [(student, place) for place, student, *_ in table.texts]


@pytest.mark.parametrize(
    ("values", "highest", "expected"),
    [
        ([(40,), (30,), (50,)], False, [("b", "1"), ("a", "2"), ("c", "3")]),
        ([(40,), (30,), (50,)], True, [("c", "1"), ("a", "2"), ("b", "3")]),
        ([(40,), (30,), (40.001,), (50,)], False, [("b", "1"), ("a", "2="), ("c", "2="), ("d", "4")]),
        ([(), (40, 60), (49,), ()], False, [("c", "1"), ("b", "2"), ("a", ""), ("d", "")]),
    ],
)
def test_equal_figures_share_a_place_and_the_next_one_is_left_out(
    values: list[tuple[float, ...]], highest: bool, expected: list[tuple[str, str]]
) -> None:
    assert places(*values, highest=highest) == expected


@pytest.mark.parametrize(
    ("values", "interval"),
    [
        ((10.0,), ""),
        # By hand: 11 +- 12.706 * sqrt(2) / sqrt(2), and 12 +- 2.776 * 1.5811 / sqrt(5).
        ((10.0, 12.0), "-1.71 to 23.71"),
        ((10.0, 11.0, 12.0, 13.0, 14.0), "10.04 to 13.96"),
        ((7.0,) * 40, "7.00 to 7.00"),
    ],
)
def test_the_interval_is_that_of_the_mean_of_the_trials(values: tuple[float, ...], interval: str) -> None:
    (row,) = RankTable("a", "T", "x", "", rank_students([StudentMeasures("ada", values, 50)], highest=False)).texts
    assert row[3:] == (interval, f"{len(values)} of 50")
