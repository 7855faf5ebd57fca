"""Appeals by students and answers by instructors. Changes no marks; ``overrides.py`` does."""

from __future__ import annotations

from dataclasses import dataclass, replace
from datetime import datetime

from sqlalchemy import Select, and_, func, or_, select
from sqlalchemy.orm import Session

from service.store import audit, webhook_events
from service.store.courses import policies
from service.store.courses.hidden_names import HiddenNames
from service.store.engine import now
from service.store.grades import current_grades
from service.store.locks import lock_submissions
from service.store.states import Standing
from service.store.tables.courses import AssignmentVersion
from service.store.tables.grades import Appeal
from service.store.tables.people import Enrolment
from service.store.tables.submissions import Job, SubmissionRow
from sim.errors import UsageError

MAX_TEXT_LENGTH = 4000


@dataclass(frozen=True, slots=True)
class AppealLine:
    """An appeal, answered or open."""

    id: int
    submission_id: int
    who: str  # the student, or a label if the assignment hides names
    assignment: str
    title: str  # of the assignment
    attempt: int  # the student's
    job_id: str  # the standing grade
    text: str
    asked_at: datetime
    answer: str | None
    answered_by: str | None
    answered_at: datetime | None


def can_appeal(session: Session, submission_id: int) -> bool:
    """Return whether the submission has a grade that its student may see."""
    visible_grade = select(Job.id).join(SubmissionRow, Job.submission_id == SubmissionRow.id)
    is_visible = (*current_grades.CAN_COUNT, policies.match_released(now(session)))
    visible_grade = visible_grade.where(SubmissionRow.id == submission_id, *is_visible)
    return session.scalar(visible_grade) is not None


def open_appeal(session: Session, submission_id: int, text: str) -> int:
    """Open an appeal against the grade of a submission and return the appeal's id.

    Raises UsageError if the student may not see a grade, an appeal is open already, or the text is empty or too long.
    """
    text = text.replace("\r\n", "\n").strip()
    if not 0 < len(text) <= MAX_TEXT_LENGTH:
        raise UsageError(
            "the appeal has %(count)s characters, expected 1 to %(most)s", count=len(text), most=MAX_TEXT_LENGTH
        )
    # Serialises concurrent appeals, so that the second one finds the first open.
    lock_submissions(session, SubmissionRow.id == submission_id)
    if not can_appeal(session, submission_id):
        raise UsageError("you can appeal after your grade is visible")
    open_query = select(Appeal.id).where(Appeal.submission_id == submission_id, Appeal.answered_at.is_(None))
    if session.scalar(open_query) is not None:
        raise UsageError("you already have an open appeal; wait for the answer before you appeal again")
    row = Appeal(submission_id=submission_id, text=text, asked_at=now(session))
    session.add(row)
    session.flush()
    webhook_events.emit_appeal_opened(session, submission_id, row.id)
    return row.id


def answer_appeal(session: Session, course_id: int, appeal_id: int, text: str, actor: str) -> None:
    """Answer and close an open appeal of the course.

    Raises UsageError if the appeal does not exist or is answered, or the text is empty or too long.
    """
    text = text.replace("\r\n", "\n").strip()
    if not 0 < len(text) <= MAX_TEXT_LENGTH:
        raise UsageError(
            "the answer has %(count)s characters, expected 1 to %(most)s", count=len(text), most=MAX_TEXT_LENGTH
        )
    row = session.get(Appeal, appeal_id, with_for_update={"key_share": True})
    if row is None or _find_course(session, row) != course_id:
        raise UsageError("this course has no appeal %(appeal_id)s", appeal_id=appeal_id)
    if row.answered_at is not None:
        raise UsageError("appeal %(appeal_id)s already has an answer", appeal_id=appeal_id)
    row.answer, row.actor, row.answered_at = text, actor, now(session)
    audit.record_action(session, actor, "answer appeal", "submission", str(row.submission_id), appeal=appeal_id)


def count_open_appeals(session: Session, course_id: int) -> int:
    """Return the number of open appeals of a course."""
    query = select(func.count()).select_from(Appeal).join(SubmissionRow, Appeal.submission_id == SubmissionRow.id)
    open_in_course = (Enrolment.course_id == course_id, Appeal.answered_at.is_(None))
    return session.scalar(query.join(Enrolment, SubmissionRow.enrolment_id == Enrolment.id).where(*open_in_course)) or 0


def list_open_appeals(
    session: Session, course_id: int, hidden_names: HiddenNames, *, limit: int | None = None, last_id: int | None = None
) -> list[AppealLine]:
    """Return the open appeals of a course, oldest first.

    ``last_id`` is the id of the last appeal on the previous page.
    """
    query = _select_lines().where(Enrolment.course_id == course_id, Appeal.answered_at.is_(None))
    if last_id is not None:
        query = query.where(Appeal.id > last_id)
    return _hide_names(_load_lines(session, query.order_by(Appeal.id).limit(limit)), hidden_names)


def list_answered_appeals(
    session: Session,
    course_id: int,
    hidden_names: HiddenNames,
    *,
    limit: int | None = None,
    cursor: tuple[datetime, int] | None = None,
) -> list[AppealLine]:
    """Return the answered appeals of a course, newest answer first.

    ``cursor`` is the answer time and id of the last appeal on the previous page.
    """
    query = _select_lines().where(Enrolment.course_id == course_id, Appeal.answered_at.is_not(None))
    if cursor is not None:
        answered_at, last_id = cursor
        query = query.where(
            or_(Appeal.answered_at < answered_at, and_(Appeal.answered_at == answered_at, Appeal.id < last_id))
        )
    return _hide_names(
        _load_lines(session, query.order_by(Appeal.answered_at.desc(), Appeal.id.desc()).limit(limit)), hidden_names
    )


def _hide_names(appeals: list[AppealLine], hidden_names: HiddenNames) -> list[AppealLine]:
    return [replace(each, who=hidden_names.label_student(each.assignment, each.who)) for each in appeals]


def load_appeals(session: Session, submission_id: int) -> list[AppealLine]:
    """Return the appeals of a submission, newest first, as its student sees them."""
    return _load_lines(session, _select_lines().where(Appeal.submission_id == submission_id).order_by(Appeal.id.desc()))


def load_newest_appeals(session: Session, enrolment_id: int) -> dict[str, AppealLine]:
    """Return a student's newest appeal for each assignment."""
    query = _select_lines().where(SubmissionRow.enrolment_id == enrolment_id).order_by(Appeal.id)
    return {each.assignment: each for each in _load_lines(session, query)}


_LineQuery = Select[Appeal, SubmissionRow, str, str, str]


def _find_course(session: Session, row: Appeal) -> int:
    enrolment_id = session.get_one(SubmissionRow, row.submission_id).enrolment_id
    return session.get_one(Enrolment, enrolment_id).course_id


def _select_lines() -> _LineQuery:
    return (
        select(Appeal, SubmissionRow, Enrolment.student, Job.id, AssignmentVersion.title)
        .join(SubmissionRow, Appeal.submission_id == SubmissionRow.id)
        .join(Enrolment, SubmissionRow.enrolment_id == Enrolment.id)
        .join(Job, and_(Job.submission_id == SubmissionRow.id, Job.standing == Standing.STANDS))
        .join(AssignmentVersion, Job.assignment_version_id == AssignmentVersion.id)
    )


def _load_lines(session: Session, query: _LineQuery) -> list[AppealLine]:
    return [
        AppealLine(
            id=row.id,
            submission_id=submission.id,
            who=student,
            assignment=submission.assignment,
            title=title,
            attempt=submission.attempt,
            job_id=job_id,
            text=row.text,
            asked_at=row.asked_at,
            answer=row.answer,
            answered_by=row.actor,
            answered_at=row.answered_at,
        )
        for row, submission, student, job_id, title in session.execute(query)
    ]
