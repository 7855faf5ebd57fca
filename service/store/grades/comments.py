"""Comments by staff for the student, on a whole submission or on one criterion. Changes no marks.

``reports/view.py`` decides when a student sees them.
"""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass
from datetime import datetime

from sqlalchemy import exists, select
from sqlalchemy.orm import Session

from service.store import audit
from service.store.engine import now
from service.store.tables.grades import Comment, CriterionResultRow
from service.store.tables.submissions import Job
from sim.errors import UsageError

MAX_COMMENT_LENGTH = 2000


@dataclass(frozen=True, slots=True)
class CommentLine:
    """A comment; an empty ``criterion`` refers to the whole submission."""

    id: int
    criterion: str
    text: str
    actor: str
    made_at: datetime


def add_comment(session: Session, job_id: str, criterion: str, text: str, actor: str) -> int:
    """Add a comment to the submission of this grade and return the comment's id.

    Raises UsageError for an unknown criterion, or a text that is empty or too long.
    """
    text = text.replace("\r\n", "\n").strip()
    if not 0 < len(text) <= MAX_COMMENT_LENGTH:
        raise UsageError(
            "the comment has %(count)s characters, expected 1 to %(most)s", count=len(text), most=MAX_COMMENT_LENGTH
        )
    criterion_exists = exists().where(CriterionResultRow.job_id == job_id, CriterionResultRow.criterion == criterion)
    if criterion and not session.scalar(select(criterion_exists)):
        raise UsageError(
            "grade %(job)s has no criterion %(criterion)s%(hint)s", job=job_id, criterion=repr(criterion[:80]), hint=""
        )
    submission_id = session.get_one(Job, job_id).submission_id
    row = Comment(submission_id=submission_id, criterion=criterion, text=text, actor=actor, made_at=now(session))
    session.add(row)
    session.flush()
    audit.record_action(
        session, actor, "comment", "submission", str(submission_id), criterion=criterion, comment=row.id
    )
    return row.id


def withdraw_comment(session: Session, job_id: str, comment_id: int, actor: str) -> None:
    """Withdraw a comment, so that it is no longer shown.

    Raises UsageError if this grade's submission does not have it.
    """
    submission_id = session.get_one(Job, job_id).submission_id
    row = session.get(Comment, comment_id)
    if row is None or row.submission_id != submission_id or row.withdrawn_at is not None:
        raise UsageError("grade %(job)s has no comment %(comment)s", job=job_id, comment=comment_id)
    row.withdrawn_at = now(session)
    audit.record_action(session, actor, "withdraw comment", "submission", str(submission_id), comment=comment_id)


def load_comments(session: Session, job_id: str) -> list[CommentLine]:
    """Return the comments on the submission of a job, oldest first."""
    return load_comments_by_job(session, [job_id]).get(job_id, [])


def load_comments_by_job(session: Session, job_ids: Collection[str]) -> dict[str, list[CommentLine]]:
    """Return the comments by job, without jobs that have none."""
    query = (
        select(Job.id, Comment)
        .join(Comment, Comment.submission_id == Job.submission_id)
        .where(Job.id.in_(job_ids), Comment.withdrawn_at.is_(None))
        .order_by(Comment.id)
    )
    comments_by_job: dict[str, list[CommentLine]] = {}
    for job_id, row in session.execute(query):
        comments_by_job.setdefault(job_id, []).append(
            CommentLine(row.id, row.criterion, row.text, row.actor, row.made_at)
        )
    return comments_by_job
