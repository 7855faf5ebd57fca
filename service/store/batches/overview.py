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
from service.store.grades.marked import marked
from service.store.models import Enrolment, Person, SubmissionRow
from service.store.states import JobState, Role
from submissions.people import Student

#: Of all marks, where nobody says otherwise.
PASS_SHARE = Decimal("0.4")


@dataclass(frozen=True, slots=True)
class ClassOverview:
    """Of one assignment; ``identical`` are those whose submissions are the very same, each group of them."""

    statistics: AssignmentStatistics
    distribution: tuple[MarksBin, ...]
    passed: int
    outliers: tuple[Outlier, ...]
    identical: tuple[tuple[TableLine, ...], ...]
    missing: tuple[Student, ...]  # in the course, without any submission for it


def overview(
    session: Session, course_id: int, lines: Sequence[TableLine], pass_share: Decimal
) -> tuple[ClassOverview, ...]:
    """Of the rows of a batch, by assignment."""
    graded = [line for line in lines if line.state == JobState.DONE and line.staff_only is None]
    found = []
    for statistics in statistics_of(marked(session, graded)):
        own = [line for line in graded if line.assignment == statistics.assignment and line.marks is not None]
        taken = [MarksAndTime(line.id, line.share, line.seconds) for line in own]
        found.append(
            ClassOverview(
                statistics,
                distribution((line.marks for line in own if line.marks is not None), statistics.max_marks),
                sum(line.share >= pass_share for line in own),
                outliers(taken, pass_share),
                _identical([line for line in lines if line.assignment == statistics.assignment]),
                missing(session, course_id, statistics.assignment),
            )
        )
    return tuple(found)


def _identical(lines: Sequence[TableLine]) -> tuple[tuple[TableLine, ...], ...]:
    of_bytes: dict[str, list[TableLine]] = {}
    for line in lines:
        if line.state != REFUSED:
            of_bytes.setdefault(line.sha256, []).append(line)
    return tuple(tuple(same) for same in of_bytes.values() if len(same) > 1)


def missing(session: Session, course_id: int, assignment: str) -> tuple[Student, ...]:
    """Who is in a course and has submitted nothing for an assignment."""
    of_student = (SubmissionRow.enrolment_id == Enrolment.id, SubmissionRow.assignment == assignment)
    query = (
        select(Enrolment.student, Person.name)
        .join(Person, Enrolment.person_id == Person.id)
        .where(Enrolment.course_id == course_id, Enrolment.role == Role.STUDENT, ~exists().where(*of_student))
        .order_by(Enrolment.student)
    )
    return tuple(Student(student, name) for student, name in session.execute(query))
