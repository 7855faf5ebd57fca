"""Statistics of a class for an assignment, checked with figures calculated by hand."""

from __future__ import annotations

from decimal import Decimal

import pytest

from report_builders import shape_grade
from service.grading.class_statistics import MarkedCriterion, MarkedSubmission, compute_statistics, to_marked_submission


def _marked(who: str, *marks: int, verdict: str = "finished", assignment: str = "echo") -> MarkedSubmission:
    """Return a submission's marks for criteria a, b ... with 4 marks each."""
    criteria = tuple(
        MarkedCriterion(name, f"Does {name}", Decimal(got), Decimal(4)) for name, got in zip("abc", marks, strict=False)
    )
    return MarkedSubmission(who, assignment, Decimal(sum(marks)), Decimal(4 * len(marks)), verdict, criteria)


def test_a_class_of_four() -> None:
    (statistics,) = compute_statistics(
        [_marked("dan", 4, 4), _marked("bob", 4, 0), _marked("ada", 2, 0), _marked("cyd", 0, 0, verdict="cpu_limit")]
    )
    assert (statistics.n, statistics.max_marks, statistics.mean) == (4, 8, 3.5)
    assert (statistics.lowest, statistics.median, statistics.highest) == (0, 3, 8)
    assert statistics.spread == pytest.approx(3.4157, abs=1e-4)
    assert [(each.title, each.n, each.mean_share) for each in statistics.criteria] == [
        ("Does a", 4, 0.625),
        ("Does b", 4, 0.25),
    ]
    assert [(cause.sentence, cause.students) for cause in statistics.causes] == [
        ("lost marks for: Does b", ("ada", "bob")),
        ("computed for too long", ("cyd",)),
        ("lost marks for: Does a", ("ada",)),
    ]


def test_each_assignment_by_itself_and_nothing_of_none() -> None:
    statistics = compute_statistics([_marked("ada", 4, assignment="walk"), _marked("ada", 2, assignment="echo")])
    assert [(each.assignment, each.mean, each.spread) for each in statistics] == [("echo", 2, None), ("walk", 4, None)]
    assert statistics[1].causes == ()
    assert compute_statistics([]) == ()


def test_a_fault_that_cost_no_marks_is_no_cause() -> None:
    (statistics,) = compute_statistics([_marked("ada", 4, 4, verdict="time_limit")])
    assert statistics.causes == ()


def test_who_was_still_running_at_the_end_lost_marks_for_criteria_too() -> None:
    (statistics,) = compute_statistics([_marked("ada", 4, 0, verdict="time_limit")])
    assert [(cause.sentence, cause.criterion) for cause in statistics.causes] == [
        ("lost marks for: Does b", "Does b"),
        ("still running at the end", ""),
    ]


def test_of_a_grade_the_criteria_that_were_judged_count() -> None:
    grade = shape_grade()
    marked = to_marked_submission(grade)
    assert (marked.marks, marked.max_marks, marked.verdict) == (grade.marks, grade.max_marks, "finished")
    assert [each.id for each in marked.criteria] == [each.id for each in grade.criteria if not each.unjudged]
