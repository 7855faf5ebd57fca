"""Passback of published marks to a platform's gradebook: the standing grade of each student that it knows."""

from __future__ import annotations

from sqlalchemy import select
from sqlalchemy.orm import Session

from service.lti.services import Score, send_scores
from service.store.engine import Store, now
from service.store.grades import current_grades
from service.store.people import lti
from service.store.people.lti import CourseLink
from service.store.tables.courses import AssignmentVersion
from service.store.tables.people import Enrolment
from service.store.tables.submissions import Job, SubmissionRow
from sim.errors import UsageError


def send_marks(store: Store, link: CourseLink, course_id: int, assignment: str) -> int:
    """Send the published marks of an assignment. Returns their number.

    Raises UsageError without submissions to it in the course, PlatformError if the platform does not accept them.
    """
    with store.reading() as session:
        title = session.scalar(
            select(AssignmentVersion.title)
            .join(Job, Job.assignment_version_id == AssignmentVersion.id)
            .join(Enrolment, Job.enrolment_id == Enrolment.id)
            .where(Enrolment.course_id == course_id, AssignmentVersion.assignment == assignment)
            .order_by(AssignmentVersion.id.desc())
            .limit(1)
        )
        if title is None:
            raise UsageError(f"no student of this course has submitted to {assignment!r}")
        scores = _load_published_scores(session, link, course_id, assignment)
    return send_scores(store, link, assignment, title, scores)


def _load_published_scores(session: Session, link: CourseLink, course_id: int, assignment: str) -> list[Score]:
    """Return the current attempt of each student whose grade is published and not excused completely."""
    subjects = lti.load_subjects(session, link.platform, course_id)
    query = (
        select(Enrolment.student, Job.marks, Job.max_marks)
        .join(SubmissionRow, Job.submission_id == SubmissionRow.id)
        .join(Enrolment, SubmissionRow.enrolment_id == Enrolment.id)
        .where(
            Enrolment.course_id == course_id,
            SubmissionRow.assignment == assignment,
            SubmissionRow.id.in_(current_grades.select_counted_submissions(SubmissionRow.assignment == assignment)),
            *current_grades.CAN_COUNT,
            Job.published_at.is_not(None),
        )
        .order_by(SubmissionRow.id)
    )
    # A platform ignores scores that are not newer than its own, and marks can change after publication.
    sent_at = now(session)
    return [
        Score(subjects[student], marks, max_marks, sent_at)
        for student, marks, max_marks in session.execute(query)
        if student in subjects and marks is not None and max_marks
    ]
