"""Students who ask for a second look at a grade, and what instructors answer. It changes no marks.

What comes of the second look is set by ``overrides.py``.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from datetime import datetime

from sqlalchemy import Select, and_, func, or_, select
from sqlalchemy.orm import Session

from service.store import audit, outbox
from service.store.courses.hidden_names import HiddenNames
from service.store.engine import now
from service.store.grades import current
from service.store.locks import lock_submissions
from service.store.models import AssignmentVersion, Enrolment, Job, SubmissionRow
from service.store.states import Standing
from service.store.web_tables import Appeal
from sim.errors import UsageError

LONGEST_TEXT = 4000


@dataclass(frozen=True, slots=True)
class AppealLine:
    """One appeal, answered or open."""

    id: int
    submission_id: int
    who: str  # the student, by another name where those of the assignment are hidden
    assignment: str
    title: str  # of the assignment
    attempt: int  # the student's
    job_id: str  # the grade that stands
    text: str
    asked_at: datetime
    answer: str | None
    answered_by: str | None
    answered_at: datetime | None


def may_appeal(session: Session, submission_id: int) -> bool:
    """Whether there is a grade that its student may see."""
    seen = select(Job.id).join(SubmissionRow, Job.submission_id == SubmissionRow.id)
    seen = seen.where(SubmissionRow.id == submission_id, *current.CAN_COUNT)
    return session.scalar(seen) is not None


def ask(session: Session, submission_id: int, text: str) -> int:
    """Ask for a second look at a submission's grade. Returns the appeal's id.

    Raises UsageError where there is no grade that the student may see, an appeal is open, or the text is empty or too
    long.
    """
    text = text.replace("\r\n", "\n").strip()
    if not 0 < len(text) <= LONGEST_TEXT:
        raise UsageError(
            "the text has %(count)s characters, expected 1 to %(most)s", count=len(text), most=LONGEST_TEXT
        )
    # One writer at a time, so that of two at once one finds the other open.
    lock_submissions(session, SubmissionRow.id == submission_id)
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
        raise UsageError(
            "the answer has %(count)s characters, expected 1 to %(most)s", count=len(text), most=LONGEST_TEXT
        )
    row = session.get(Appeal, appeal_id, with_for_update={"key_share": True})
    if row is None or _course_of(session, row) != course_id:
        raise UsageError("there is no appeal %(appeal_id)s in this course", appeal_id=appeal_id)
    if row.answered_at is not None:
        raise UsageError("appeal %(appeal_id)s is answered already", appeal_id=appeal_id)
    row.answer, row.actor, row.answered_at = text, actor, now(session)
    audit.note(session, actor, "answer appeal", "submission", str(row.submission_id), appeal=appeal_id)


def waiting(session: Session, course_id: int) -> int:
    """How many of a course wait for an answer."""
    query = select(func.count()).select_from(Appeal).join(SubmissionRow, Appeal.submission_id == SubmissionRow.id)
    mine = (Enrolment.course_id == course_id, Appeal.answered_at.is_(None))
    return session.scalar(query.join(Enrolment, SubmissionRow.enrolment_id == Enrolment.id).where(*mine)) or 0


def open_in_course(
    session: Session, course_id: int, hidden: HiddenNames, *, limit: int | None = None, after: int | None = None
) -> list[AppealLine]:
    """The appeals of a course that wait for an answer, the longest waiting first.

    ``after`` is the id of the last appeal of the page before.
    """
    query = _lines().where(Enrolment.course_id == course_id, Appeal.answered_at.is_(None))
    if after is not None:
        query = query.where(Appeal.id > after)
    return _called(_read(session, query.order_by(Appeal.id).limit(limit)), hidden)


def answered_in_course(
    session: Session,
    course_id: int,
    hidden: HiddenNames,
    *,
    limit: int | None = None,
    after: tuple[datetime, int] | None = None,
) -> list[AppealLine]:
    """The answered appeals of a course, the newest answer first.

    ``after`` is when the last appeal of the page before was answered, and its id.
    """
    query = _lines().where(Enrolment.course_id == course_id, Appeal.answered_at.is_not(None))
    if after is not None:
        at, last = after
        query = query.where(or_(Appeal.answered_at < at, and_(Appeal.answered_at == at, Appeal.id < last)))
    return _called(_read(session, query.order_by(Appeal.answered_at.desc(), Appeal.id.desc()).limit(limit)), hidden)


def _called(found: list[AppealLine], hidden: HiddenNames) -> list[AppealLine]:
    return [replace(each, who=hidden.called(each.assignment, each.who)) for each in found]


def of_submission(session: Session, submission_id: int) -> list[AppealLine]:
    """The appeals of one submission, the newest first, as its student sees them."""
    return _read(session, _lines().where(Appeal.submission_id == submission_id).order_by(Appeal.id.desc()))


def newest_of(session: Session, enrolment_id: int) -> dict[str, AppealLine]:
    """What one student asked last, by assignment."""
    query = _lines().where(SubmissionRow.enrolment_id == enrolment_id).order_by(Appeal.id)
    return {each.assignment: each for each in _read(session, query)}


_Lines = Select[Appeal, SubmissionRow, str, str, str]


def _course_of(session: Session, row: Appeal) -> int:
    enrolment_id = session.get_one(SubmissionRow, row.submission_id).enrolment_id
    return session.get_one(Enrolment, enrolment_id).course_id


def _lines() -> _Lines:
    return (
        select(Appeal, SubmissionRow, Enrolment.student, Job.id, AssignmentVersion.title)
        .join(SubmissionRow, Appeal.submission_id == SubmissionRow.id)
        .join(Enrolment, SubmissionRow.enrolment_id == Enrolment.id)
        .join(Job, and_(Job.submission_id == SubmissionRow.id, Job.standing == Standing.STANDS))
        .join(AssignmentVersion, Job.assignment_version_id == AssignmentVersion.id)
    )


def _read(session: Session, query: _Lines) -> list[AppealLine]:
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
