"""Current grades of the students of a course in all its assignments. Read-only; the caller checks permission.

``current_grades.py`` defines which attempt is the current one.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass
from datetime import datetime
from decimal import Decimal

from sqlalchemy import func, select
from sqlalchemy.orm import Session

from service.store.grades.current_grades import is_for_students, select_shown_submissions
from service.store.states import JobState, Standing
from service.store.tables.courses import AssignmentVersion
from service.store.tables.people import Enrolment
from service.store.tables.submissions import Job, SubmissionRow


@dataclass(frozen=True, slots=True)
class GradebookCell:
    """The grade that counts for a student in an assignment; the newest attempt if none counts.

    ``marks`` are those that count, None if none do.
    """

    enrolment_id: int
    assignment: str
    job_id: str
    state: JobState
    marks: Decimal | None
    max_marks: Decimal
    days_late: int
    published_at: datetime | None
    provisional: bool  # the marks depend on a pool of which not all trials were run

    @property
    def share(self) -> Decimal:
        """Marks as a fraction of the maximum; -1 without marks, so that the student sorts last."""
        return Decimal(-1) if self.marks is None or not self.max_marks else self.marks / self.max_marks


def load_cells(
    session: Session, enrolment_ids: Sequence[int], hidden: Collection[str] = (), only: str = ""
) -> list[GradebookCell]:
    """Return the cells of these students, without hidden assignments, and with an ``only`` one if it is not empty."""
    is_shown = [
        SubmissionRow.enrolment_id.in_(enrolment_ids),
        SubmissionRow.assignment.not_in(hidden),
        *([SubmissionRow.assignment == only] if only else []),
    ]
    query = (
        select(
            SubmissionRow.enrolment_id,
            SubmissionRow.assignment,
            SubmissionRow.days_late,
            SubmissionRow.staff_only,
            Job.id,
            Job.state,
            Job.suspect,
            Job.marks,
            func.coalesce(Job.max_marks, AssignmentVersion.max_marks).label("max_marks"),
            Job.published_at,
            Job.provisional,
        )
        .join(SubmissionRow, Job.submission_id == SubmissionRow.id)
        .join(AssignmentVersion, Job.assignment_version_id == AssignmentVersion.id)
        .where(SubmissionRow.id.in_(select_shown_submissions(*is_shown)), Job.standing == Standing.STANDS)
    )
    return [
        GradebookCell(
            row.enrolment_id,
            row.assignment,
            row.id,
            row.state,
            row.marks if is_for_students(row) else None,
            row.max_marks,
            row.days_late,
            row.published_at,
            row.provisional,
        )
        for row in session.execute(query)
    ]


def list_submitted_assignments(session: Session, course_id: int) -> list[str]:
    """Return the assignments that students of a course have submitted to, ordered by id."""
    query = (
        select(SubmissionRow.assignment)
        .join(Enrolment, SubmissionRow.enrolment_id == Enrolment.id)
        .where(Enrolment.course_id == course_id)
        .distinct()
    )
    return sorted(session.scalars(query))
