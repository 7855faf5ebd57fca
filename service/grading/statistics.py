"""What a class got for an assignment: mean, spread, each criterion's share of its marks, and what cost marks most.

A pure function of marks that are there already; it reads no database and judges nothing.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from decimal import ROUND_HALF_UP, Decimal
from math import sqrt
from typing import TYPE_CHECKING

from service.grading.endings import ENDED
from sim.recording import Verdict

if TYPE_CHECKING:
    from service.grading.grade import Grade

_BINS, _MOST_BINS = 10, 15
_HUNDREDTH = Decimal("0.01")
#: Share of all marks that passes, where nobody names another.
PASS_SHARE = Decimal("0.4")


@dataclass(frozen=True, slots=True)
class MarkedCriterion:
    """One criterion of one submission, as far as it could be judged."""

    id: str
    title: str
    marks: Decimal
    max_marks: Decimal


@dataclass(frozen=True, slots=True)
class MarkedSubmission:
    """One submission that has marks, out of all that its assignment gives: others count for an excused criterion."""

    who: str
    assignment: str
    marks: Decimal
    max_marks: Decimal
    verdict: str
    criteria: tuple[MarkedCriterion, ...]


@dataclass(frozen=True, slots=True)
class CriterionStatistics:
    """``mean_share`` is the mean of what ``n`` submissions got of its marks, 0 to 1; ``full`` of them got all."""

    id: str
    title: str
    n: int
    mean_share: float
    full: int
    lost: Decimal  # marks, by all of them together


@dataclass(frozen=True, slots=True)
class Cause:
    """What cost these students marks; ``criterion`` is the title of the one that they lost them for, if it is one."""

    sentence: str
    students: tuple[str, ...]
    criterion: str = ""


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


@dataclass(frozen=True, slots=True)
class MarksBin:
    """How many got from ``low`` to below ``high``; the last bin has those with all marks."""

    low: Decimal
    high: Decimal
    count: int


def distribution(marks: Iterable[Decimal], max_marks: Decimal) -> tuple[MarksBin, ...]:
    """A bin a mark where there are few, else ten, and one more for all marks; none where nothing is to be got."""
    if max_marks <= 0:
        return ()
    is_few = max_marks == int(max_marks) and max_marks <= _MOST_BINS
    steps = int(max_marks) if is_few else _BINS
    counts = [0] * (steps + 1)
    for each in marks:
        counts[min(steps, int(each * steps / max_marks))] += 1
    edges = [max_marks * step / steps for step in range(steps + 1)]
    return tuple(MarksBin(*pair) for pair in zip(edges, [*edges[1:], max_marks], counts, strict=True))


def marks_out_of_all(marks: Decimal, max_marks: Decimal, worth: Decimal) -> Decimal | None:
    """Marks out of ``max_marks`` as marks out of ``worth``: where a criterion is excused, the others count for it.

    None where all criteria are excused, so that there are no marks.
    """
    if worth == max_marks:
        return marks
    if not max_marks:
        return None
    return (marks * worth / max_marks).quantize(_HUNDREDTH, ROUND_HALF_UP)


def marked_of(grade: Grade) -> MarkedSubmission:
    """A grade as statistics see it; what could not be judged is left out."""
    criteria = tuple(
        MarkedCriterion(each.id, each.title, each.marks, each.max_marks) for each in grade.criteria if not each.unjudged
    )
    marks = marks_out_of_all(grade.marks, grade.max_marks, grade.worth)
    marks = Decimal(0) if marks is None else marks
    return MarkedSubmission(grade.student, grade.assignment, marks, grade.worth, grade.verdict, criteria)


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
    of_each: dict[str, list[MarkedCriterion]] = {}
    for submission in found:
        for criterion in submission.criteria:
            if criterion.max_marks:
                of_each.setdefault(criterion.id, []).append(criterion)
    return tuple(_criterion(own) for own in of_each.values())


def _criterion(own: Sequence[MarkedCriterion]) -> CriterionStatistics:
    shares = [float(each.marks / each.max_marks) for each in own]
    return CriterionStatistics(
        own[0].id,
        own[0].title,
        len(own),
        sum(shares) / len(own),
        sum(each.marks >= each.max_marks for each in own),
        sum((each.max_marks - each.marks for each in own), Decimal(0)),
    )


def _causes(found: Sequence[MarkedSubmission]) -> tuple[Cause, ...]:
    """A submission that ended by a fault lost its marks by that; of any other each criterion counts.

    One that was still running at the end is both: that is no fault by itself.
    """
    students: dict[tuple[str, str], list[str]] = {}
    for submission in found:
        if submission.marks >= submission.max_marks:
            continue
        causes = []
        if submission.verdict != Verdict.FINISHED:
            causes.append((ENDED[Verdict(submission.verdict)], ""))
        if submission.verdict in (Verdict.FINISHED, Verdict.TIME_LIMIT):
            lost = [each.title for each in submission.criteria if each.marks < each.max_marks]
            causes += [(f"lost marks for: {title}", title) for title in lost]
        for cause in causes:
            students.setdefault(cause, []).append(submission.who)
    commonest = sorted(students.items(), key=lambda cause: (-len(cause[1]), cause[0]))
    return tuple(Cause(sentence, tuple(sorted(who)), criterion) for (sentence, criterion), who in commonest)
