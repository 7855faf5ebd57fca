"""What came of a batch at a glance: marks, criteria, causes, whom to look at, and who has not submitted. Only reads.

What is made of marks is ``service.grading``'s; near copies are ``similarities.py``'s, which takes long.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from decimal import Decimal

from sqlalchemy import exists, select
from sqlalchemy.orm import Session

from service.grading.outliers import MarksAndTime, Outlier, outliers
from service.grading.statistics import AssignmentStatistics, MarksBin, distribution, statistics_of
from service.store.batches.batch_table import REFUSED, TableLine
from service.store.courses.hidden_names import HiddenNames
from service.store.grades import current
from service.store.grades.marked import marked
from service.store.models import Enrolment, SubmissionRow
from service.store.states import Role
from submissions.student_identity import Student


@dataclass(frozen=True, slots=True)
class ClassOverview:
    """Of one assignment; ``identical`` are those whose submissions are the very same, each group of them."""

    statistics: AssignmentStatistics
    distribution: tuple[MarksBin, ...]
    passed: int
    outliers: tuple[Outlier, ...]
    identical: tuple[tuple[TableLine, ...], ...]
    missing: tuple[Student, ...]  # in the course, without any submission for it; named as rows are


def overview(
    session: Session, course_id: int, lines: Sequence[TableLine], pass_share: Decimal, hidden: HiddenNames
) -> tuple[ClassOverview, ...]:
    """Of the rows of a batch, by assignment."""
    graded = [line for line in lines if current.is_for_students(line)]
    found = []
    counted = marked(session, graded)
    for statistics in statistics_of(counted):
        # Who is excused from everything has no marks, so neither passes nor fails.
        own = [line for line in graded if line.assignment == statistics.assignment and line.share >= 0]
        marks = (each.marks for each in counted if each.assignment == statistics.assignment)
        taken = [MarksAndTime(line.id, line.share, line.seconds) for line in own]
        found.append(
            ClassOverview(
                statistics,
                distribution(marks, statistics.max_marks),
                sum(line.share >= pass_share for line in own),
                outliers(taken, pass_share),
                _identical([line for line in lines if line.assignment == statistics.assignment]),
                missing(session, course_id, statistics.assignment, hidden),
            )
        )
    return tuple(found)


def _identical(lines: Sequence[TableLine]) -> tuple[tuple[TableLine, ...], ...]:
    of_bytes: dict[str, list[TableLine]] = {}
    for line in lines:
        if line.state != REFUSED:
            of_bytes.setdefault(line.sha256, []).append(line)
    return tuple(tuple(same) for same in of_bytes.values() if len(same) > 1)


def missing(session: Session, course_id: int, assignment: str, hidden: HiddenNames) -> tuple[Student, ...]:
    """Return the students of a course who have submitted nothing for an assignment.

    Where names are hidden they have labels: by a name that leaves this list a new row could be recognised.
    """
    of_student = (SubmissionRow.enrolment_id == Enrolment.id, SubmissionRow.assignment == assignment)
    query = (
        select(Enrolment.student, Enrolment.name)
        .where(Enrolment.course_id == course_id, Enrolment.role == Role.STUDENT, ~exists().where(*of_student))
        .order_by(Enrolment.student)
    )
    found = [Student(student, name) for student, name in session.execute(query)]
    if assignment not in hidden.assignments:
        return tuple(found)
    return tuple(Student(label) for label in sorted(hidden.called(assignment, each.id) for each in found))
