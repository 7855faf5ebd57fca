"""Statistics of a class for an assignment: mean, spread, share of marks by criterion, common causes of lost marks.

A pure function of existing marks. It reads no database and does not judge anything.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from decimal import ROUND_HALF_UP, Decimal
from math import sqrt
from typing import TYPE_CHECKING

from service.grading.verdict_labels import VERDICT_LABELS
from sim.recording import Verdict
from sim.sentences import Sentence

if TYPE_CHECKING:
    from service.grading.grade import Grade

#: The default pass mark, as a fraction of all marks.
PASS_SHARE = Decimal("0.4")
_BINS, _MAX_BINS = 10, 15
_HUNDREDTH = Decimal("0.01")


@dataclass(frozen=True, slots=True)
class MarkedCriterion:
    """One criterion of one submission that could be judged."""

    id: str
    title: str
    marks: Decimal
    max_marks: Decimal
    has_hidden_trials: bool = False  # students do not see all its trials, or not the criterion itself


@dataclass(frozen=True, slots=True)
class MarkedSubmission:
    """One marked submission, scaled to the assignment's full marks: other criteria make up for an excused one."""

    who: str
    assignment: str
    marks: Decimal
    max_marks: Decimal
    verdict: str
    criteria: tuple[MarkedCriterion, ...]


@dataclass(frozen=True, slots=True)
class CriterionStatistics:
    """Statistics of one criterion.

    ``mean_share`` is the mean fraction of its marks over ``n`` submissions, 0 to 1. ``full`` of them got all marks.
    """

    id: str
    title: str
    n: int
    mean_share: float
    full: int
    lost: Decimal  # total marks lost by all submissions


@dataclass(frozen=True, slots=True)
class Cause:
    """A reason why these students lost marks. ``criterion`` is the title of the affected criterion, if there is one."""

    sentence: str
    students: tuple[str, ...]
    criterion: str = ""


@dataclass(frozen=True, slots=True)
class AssignmentStatistics:
    """Statistics of ``n`` submissions for one assignment. ``spread`` is the standard deviation, None for n = 1."""

    assignment: str
    n: int
    max_marks: Decimal
    mean: float
    spread: float | None
    lowest: Decimal
    median: Decimal
    highest: Decimal
    criteria: tuple[CriterionStatistics, ...]
    causes: tuple[Cause, ...]  # most common first


@dataclass(frozen=True, slots=True)
class MarksBin:
    """The number of students from ``low`` to below ``high``. The last bin has those with full marks."""

    low: Decimal
    high: Decimal
    count: int


def compute_distribution(marks: Iterable[Decimal], max_marks: Decimal) -> tuple[MarksBin, ...]:
    """Return one bin per mark if there are few, otherwise ten, plus one for full marks. Empty if the maximum is 0."""
    if max_marks <= 0:
        return ()
    is_few = max_marks == int(max_marks) and max_marks <= _MAX_BINS
    steps = int(max_marks) if is_few else _BINS
    counts = [0] * (steps + 1)
    for each in marks:
        counts[min(steps, int(each * steps / max_marks))] += 1
    edges = [max_marks * step / steps for step in range(steps + 1)]
    return tuple(MarksBin(*pair) for pair in zip(edges, [*edges[1:], max_marks], counts, strict=True))


def scale_marks(marks: Decimal, max_marks: Decimal, worth: Decimal) -> Decimal | None:
    """Scale marks out of ``max_marks`` to marks out of ``worth``: the others make up for an excused criterion.

    Returns None if all criteria are excused.
    """
    if worth == max_marks:
        return marks
    if not max_marks:
        return None
    return (marks * worth / max_marks).quantize(_HUNDREDTH, ROUND_HALF_UP)


def to_marked_submission(grade: Grade) -> MarkedSubmission:
    """Convert a grade for statistics, without criteria that could not be judged."""
    criteria = tuple(
        MarkedCriterion(
            each.id,
            each.title,
            each.marks,
            each.max_marks,
            has_hidden_trials=each.visibility != "visible" or each.shown is not None,
        )
        for each in grade.criteria
        if not each.unjudged
    )
    marks = scale_marks(grade.marks, grade.max_marks, grade.worth)
    marks = Decimal(0) if marks is None else marks
    return MarkedSubmission(grade.student, grade.assignment, marks, grade.worth, grade.verdict, criteria)


def compute_statistics(submissions: Iterable[MarkedSubmission]) -> tuple[AssignmentStatistics, ...]:
    """Return the statistics of each assignment that has a submission, in order of name."""
    by_assignment: dict[str, list[MarkedSubmission]] = {}
    for submission in submissions:
        by_assignment.setdefault(submission.assignment, []).append(submission)
    return tuple(_compute_assignment_statistics(name, found) for name, found in sorted(by_assignment.items()))


def _compute_assignment_statistics(assignment: str, submissions: Sequence[MarkedSubmission]) -> AssignmentStatistics:
    marks = sorted(submission.marks for submission in submissions)
    n = len(marks)
    mean = float(sum(marks)) / n
    middle_marks = marks[(n - 1) // 2 : n // 2 + 1]
    return AssignmentStatistics(
        assignment=assignment,
        n=n,
        max_marks=max(submission.max_marks for submission in submissions),
        mean=mean,
        spread=sqrt(sum((float(each) - mean) ** 2 for each in marks) / (n - 1)) if n > 1 else None,
        lowest=marks[0],
        median=sum(middle_marks, Decimal(0)) / len(middle_marks),
        highest=marks[-1],
        criteria=_list_criterion_statistics(submissions),
        causes=_collect_causes(submissions),
    )


def _list_criterion_statistics(submissions: Sequence[MarkedSubmission]) -> tuple[CriterionStatistics, ...]:
    """Return the criteria in the order of the submissions. Criteria worth no marks are left out."""
    by_criterion: dict[str, list[MarkedCriterion]] = {}
    for submission in submissions:
        for criterion in submission.criteria:
            if criterion.max_marks:
                by_criterion.setdefault(criterion.id, []).append(criterion)
    return tuple(_compute_criterion_statistics(own) for own in by_criterion.values())


def _compute_criterion_statistics(criteria: Sequence[MarkedCriterion]) -> CriterionStatistics:
    shares = [float(each.marks / each.max_marks) for each in criteria]
    return CriterionStatistics(
        criteria[0].id,
        criteria[0].title,
        len(criteria),
        sum(shares) / len(criteria),
        sum(each.marks >= each.max_marks for each in criteria),
        sum((each.max_marks - each.marks for each in criteria), Decimal(0)),
    )


def _collect_causes(submissions: Sequence[MarkedSubmission]) -> tuple[Cause, ...]:
    """Return the causes of lost marks: the fault that ended a submission, otherwise each criterion.

    For a submission that was still running at the end, both count, because that alone is not a fault.
    """
    students: dict[tuple[str, str], list[str]] = {}
    for submission in submissions:
        if submission.marks >= submission.max_marks:
            continue
        causes = []
        if submission.verdict != Verdict.FINISHED:
            causes.append((VERDICT_LABELS[Verdict(submission.verdict)], ""))
        if submission.verdict in (Verdict.FINISHED, Verdict.TIME_LIMIT):
            lost_titles = [each.title for each in submission.criteria if each.marks < each.max_marks]
            causes += [(Sentence("lost marks for: %(title)s", title=title), title) for title in lost_titles]
        for cause in causes:
            students.setdefault(cause, []).append(submission.who)
    commonest = sorted(students.items(), key=lambda cause: (-len(cause[1]), cause[0]))
    return tuple(Cause(sentence, tuple(sorted(who)), criterion) for (sentence, criterion), who in commonest)
