"""Overview of a batch: marks, criteria, the task itself, causes, outliers and missing submissions. Read-only.

``service.grading`` computes the statistics. ``similarities.py`` finds similar submissions, which takes longer.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from decimal import Decimal
from typing import TYPE_CHECKING

from sqlalchemy import exists, select
from sqlalchemy.orm import Session

from service.grading.class_statistics import AssignmentStatistics, MarksBin, compute_distribution, compute_statistics
from service.grading.outliers import MarksAndTime, Outlier, find_outliers
from service.store.batches.batch_table import REFUSED, TableLine
from service.store.courses.hidden_names import HiddenNames
from service.store.grades import current_grades
from service.store.grades.statistics_marks import load_marked_submissions
from service.store.states import Role
from service.store.tables.people import Enrolment
from service.store.tables.submissions import SubmissionRow
from submissions.student_identity import Student

if TYPE_CHECKING:
    from service.grading.task_quality import TaskQuality


@dataclass(frozen=True, slots=True)
class ClassOverview:
    """Overview of one assignment; ``identical`` contains groups of submissions with the same content."""

    statistics: AssignmentStatistics
    quality: TaskQuality
    distribution: tuple[MarksBin, ...]
    passed: int
    outliers: tuple[Outlier, ...]
    identical: tuple[tuple[TableLine, ...], ...]
    missing: tuple[Student, ...]  # in the course, without a submission for it; named as in rows


def compute_overviews(
    session: Session, course_id: int, lines: Sequence[TableLine], pass_share: Decimal, hidden_names: HiddenNames
) -> tuple[ClassOverview, ...]:
    """Return the overview of each assignment in the rows of a batch."""
    # Imported here, because it imports numpy, which other views of batches do not need.
    from service.grading.task_quality import assess_task

    graded_lines = [line for line in lines if current_grades.is_for_students(line)]
    overviews = []
    marked_submissions = load_marked_submissions(session, graded_lines)
    for statistics in compute_statistics(marked_submissions):
        # A student excused from everything has no marks, so neither passes nor fails.
        assignment_lines = [
            line for line in graded_lines if line.assignment == statistics.assignment and line.share >= 0
        ]
        own_submissions = [each for each in marked_submissions if each.assignment == statistics.assignment]
        marks_and_times = [MarksAndTime(line.id, line.share, line.seconds) for line in assignment_lines]
        overviews.append(
            ClassOverview(
                statistics,
                assess_task(own_submissions),
                compute_distribution((each.marks for each in own_submissions), statistics.max_marks),
                sum(line.share >= pass_share for line in assignment_lines),
                find_outliers(marks_and_times, pass_share),
                _group_identical([line for line in lines if line.assignment == statistics.assignment]),
                load_missing_students(session, course_id, statistics.assignment, hidden_names),
            )
        )
    return tuple(overviews)


def _group_identical(lines: Sequence[TableLine]) -> tuple[tuple[TableLine, ...], ...]:
    lines_by_digest: dict[str, list[TableLine]] = {}
    for line in lines:
        if line.state != REFUSED:
            lines_by_digest.setdefault(line.sha256, []).append(line)
    return tuple(tuple(same) for same in lines_by_digest.values() if len(same) > 1)


def load_missing_students(
    session: Session, course_id: int, assignment: str, hidden_names: HiddenNames
) -> tuple[Student, ...]:
    """Return the students of a course without a submission for an assignment.

    If names are hidden, labels are returned: a real name that leaves this list would identify the new row.
    """
    is_submission = (SubmissionRow.enrolment_id == Enrolment.id, SubmissionRow.assignment == assignment)
    query = (
        select(Enrolment.student, Enrolment.name)
        .where(Enrolment.course_id == course_id, Enrolment.role == Role.STUDENT, ~exists().where(*is_submission))
        .order_by(Enrolment.student)
    )
    students = [Student(student, name) for student, name in session.execute(query)]
    if assignment not in hidden_names.assignments:
        return tuple(students)
    return tuple(
        Student(label) for label in sorted(hidden_names.label_student(assignment, each.id) for each in students)
    )
