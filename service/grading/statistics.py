"""What a class got for an assignment: mean, spread, each criterion's share of its marks, and what cost marks most.

A pure function of marks that are there already; it reads no database and judges nothing.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from decimal import Decimal
from math import sqrt
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from service.grading.grade import Grade

_FINISHED = "finished"


@dataclass(frozen=True, slots=True)
class MarkedCriterion:
    """One criterion of one submission, as far as it could be judged."""

    id: str
    title: str
    marks: Decimal
    max_marks: Decimal


@dataclass(frozen=True, slots=True)
class MarkedSubmission:
    """One submission that has marks."""

    who: str
    assignment: str
    marks: Decimal
    max_marks: Decimal
    verdict: str
    criteria: tuple[MarkedCriterion, ...]


@dataclass(frozen=True, slots=True)
class CriterionStatistics:
    """``mean_share`` is the mean of what ``n`` submissions got of its marks, 0 to 1."""

    id: str
    title: str
    n: int
    mean_share: float


@dataclass(frozen=True, slots=True)
class Cause:
    """What cost these students marks."""

    sentence: str
    students: tuple[str, ...]


@dataclass(frozen=True, slots=True)
class AssignmentStatistics:
    """Of ``n`` submissions for one assignment; ``spread`` is the standard deviation, None of a single one."""

    assignment: str
    n: int
    max_marks: Decimal
    mean: float
    spread: float | None
    lowest: Decimal
    median: Decimal
    highest: Decimal
    criteria: tuple[CriterionStatistics, ...]
    causes: tuple[Cause, ...]  # the commonest first


def marked_of(grade: Grade) -> MarkedSubmission:
    """A grade as statistics see it; what could not be judged is left out."""
    criteria = tuple(
        MarkedCriterion(each.id, each.title, each.marks, each.max_marks) for each in grade.criteria if not each.unjudged
    )
    return MarkedSubmission(grade.student, grade.assignment, grade.marks, grade.max_marks, grade.verdict, criteria)


def statistics_of(submissions: Iterable[MarkedSubmission]) -> tuple[AssignmentStatistics, ...]:
    """The statistics of each assignment there is a submission for, in the order of their names."""
    of_assignment: dict[str, list[MarkedSubmission]] = {}
    for submission in submissions:
        of_assignment.setdefault(submission.assignment, []).append(submission)
    return tuple(_of_one(name, found) for name, found in sorted(of_assignment.items()))


def _of_one(assignment: str, found: Sequence[MarkedSubmission]) -> AssignmentStatistics:
    marks = sorted(submission.marks for submission in found)
    n = len(marks)
    mean = float(sum(marks)) / n
    middle = marks[(n - 1) // 2 : n // 2 + 1]
    return AssignmentStatistics(
        assignment=assignment,
        n=n,
        max_marks=max(submission.max_marks for submission in found),
        mean=mean,
        spread=sqrt(sum((float(each) - mean) ** 2 for each in marks) / (n - 1)) if n > 1 else None,
        lowest=marks[0],
        median=sum(middle, Decimal(0)) / len(middle),
        highest=marks[-1],
        criteria=_criteria(found),
        causes=_causes(found),
    )


def _criteria(found: Sequence[MarkedSubmission]) -> tuple[CriterionStatistics, ...]:
    """In the order in which submissions have them; one that is worth nothing has no share."""
    shares: dict[str, list[float]] = {}
    titles: dict[str, str] = {}
    for submission in found:
        for criterion in submission.criteria:
            if criterion.max_marks:
                titles.setdefault(criterion.id, criterion.title)
                shares.setdefault(criterion.id, []).append(float(criterion.marks / criterion.max_marks))
    return tuple(CriterionStatistics(key, titles[key], len(own), sum(own) / len(own)) for key, own in shares.items())


def _causes(found: Sequence[MarkedSubmission]) -> tuple[Cause, ...]:
    """A submission that ended by a fault lost its marks by that; of any other each criterion counts."""
    students: dict[str, list[str]] = {}
    for submission in found:
        if submission.marks >= submission.max_marks:
            continue
        if submission.verdict != _FINISHED:
            sentences = [f"ended as {submission.verdict}"]
        else:
            sentences = [f"lost marks for: {each.title}" for each in submission.criteria if each.marks < each.max_marks]
        for sentence in sentences:
            students.setdefault(sentence, []).append(submission.who)
    commonest = sorted(students.items(), key=lambda cause: (-len(cause[1]), cause[0]))
    return tuple(Cause(sentence, tuple(sorted(who))) for sentence, who in commonest)
