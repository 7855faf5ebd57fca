"""Students who ask for a second look at a grade, and what instructors answer. It changes no marks.

What comes of the second look is set by ``overrides.py``.
"""

from __future__ import annotations

from dataclasses import dataclass
from datetime import datetime

from sqlalchemy import Select, and_, select
from sqlalchemy.orm import Session

from service.store import audit, outbox
from service.store.engine import now
from service.store.models import Enrolment, Job, SubmissionRow
from service.store.states import JobState, Standing
from service.store.web_tables import Appeal, OpenAssignment
from sim.errors import UsageError

LONGEST_TEXT = 4000


@dataclass(frozen=True, slots=True)
class AppealLine:
    """One appeal, answered or open."""

    id: int
    submission_id: int
    who: str  # the student; a number where the names of the assignment's students are hidden
    assignment: str
    attempt: int  # the student's
    job_id: str  # the grade that stands
    text: str
    asked_at: datetime
    answer: str | None
    answered_by: str | None
    answered_at: datetime | None


def may_appeal(session: Session, submission_id: int) -> bool:
    """Whether there is a grade that its student may see."""
    standing = select(Job.id).where(
        Job.submission_id == submission_id,
        Job.standing == Standing.STANDS,
        Job.state == JobState.DONE,
        Job.suspect.is_(None),
    )
    row = session.get(SubmissionRow, submission_id)
    return row is not None and row.staff_only is None and session.scalar(standing) is not None


def ask(session: Session, submission_id: int, text: str) -> int:
    """Ask for a second look at a submission's grade. Returns the appeal's id.

    Raises UsageError where there is no grade that the student may see, an appeal is open, or the text is empty or too
    long.
    """
    text = text.replace("\r\n", "\n").strip()
    if not 0 < len(text) <= LONGEST_TEXT:
        raise UsageError(f"the text has {len(text)} characters, expected 1 to {LONGEST_TEXT}")
    # One writer at a time, so that of two at once one finds the other open.
    session.execute(select(SubmissionRow.id).where(SubmissionRow.id == submission_id).with_for_update())
    if not may_appeal(session, submission_id):
        raise UsageError("there is no grade yet that could be looked at again")
    still_open = select(Appeal.id).where(Appeal.submission_id == submission_id, Appeal.answered_at.is_(None))
    if session.scalar(still_open) is not None:
        raise UsageError("you have asked already; expected one question at a time, and the answer to it first")
    row = Appeal(submission_id=submission_id, text=text, asked_at=now(session))
    session.add(row)
    session.flush()
    outbox.appeal_opened(session, submission_id, row.id)
    return row.id


def answer(session: Session, course_id: int, appeal_id: int, text: str, actor: str) -> None:
    """Answer an open appeal of the course, which closes it.

    Raises UsageError where there is none of this id, it is answered, or the text is empty or too long.
    """
    text = text.replace("\r\n", "\n").strip()
    if not 0 < len(text) <= LONGEST_TEXT:
        raise UsageError(f"the answer has {len(text)} characters, expected 1 to {LONGEST_TEXT}")
    row = session.get(Appeal, appeal_id, with_for_update=True)
    if row is None or _course_of(session, row) != course_id:
        raise UsageError(f"there is no appeal {appeal_id} in this course")
    if row.answered_at is not None:
        raise UsageError(f"appeal {appeal_id} is answered already")
    row.answer, row.actor, row.answered_at = text, actor, now(session)
    audit.note(session, actor, "answer appeal", "submission", str(row.submission_id), appeal=appeal_id)


def in_course(session: Session, course_id: int, *, answered: bool, limit: int = 100) -> list[AppealLine]:
    """The appeals of a course: the open ones, the longest waiting first, or the answered ones, the newest first."""
    which = Appeal.answered_at.is_not(None) if answered else Appeal.answered_at.is_(None)
    order = Appeal.answered_at.desc() if answered else Appeal.asked_at
    query = _lines().where(Enrolment.course_id == course_id, which).order_by(order, Appeal.id).limit(limit)
    return _read(session, query)


def of_submission(session: Session, submission_id: int) -> list[AppealLine]:
    """The appeals of one submission, the newest first."""
    return _read(session, _lines().where(Appeal.submission_id == submission_id).order_by(Appeal.id.desc()))


_Lines = Select[Appeal, SubmissionRow, str, str, bool | None]


def _course_of(session: Session, row: Appeal) -> int:
    enrolment_id = session.get_one(SubmissionRow, row.submission_id).enrolment_id
    return session.get_one(Enrolment, enrolment_id).course_id


def _lines() -> _Lines:
    of_assignment = and_(
        OpenAssignment.course_id == Enrolment.course_id, OpenAssignment.assignment == SubmissionRow.assignment
    )
    return (
        select(Appeal, SubmissionRow, Enrolment.student, Job.id, OpenAssignment.names_hidden)
        .join(SubmissionRow, Appeal.submission_id == SubmissionRow.id)
        .join(Enrolment, SubmissionRow.enrolment_id == Enrolment.id)
        .join(Job, and_(Job.submission_id == SubmissionRow.id, Job.standing == Standing.STANDS))
        .outerjoin(OpenAssignment, of_assignment)
    )


def _read(session: Session, query: _Lines) -> list[AppealLine]:
    return [
        AppealLine(
            id=row.id,
            submission_id=submission.id,
            who=f"submission {submission.id}" if hidden else student,
            assignment=submission.assignment,
            attempt=submission.attempt,
            job_id=job_id,
            text=row.text,
            asked_at=row.asked_at,
            answer=row.answer,
            answered_by=row.actor,
            answered_at=row.answered_at,
        )
        for row, submission, student, job_id, hidden in session.execute(query)
    ]
