"""Row locks, those of several rows in the order of ids, so that two transactions do not deadlock.

They are ``FOR NO KEY UPDATE``, which lets PostgreSQL check foreign keys to the locked rows. SQLite has one writer at a
time and ignores them.
"""

from __future__ import annotations

from sqlalchemy import ColumnElement, Select, select
from sqlalchemy.orm import Session

from service.store.models import Course, Installation, Job, Person, SubmissionRow


def lock_installation(session: Session) -> None:
    """Lock the installation's one row: of what exists once, one transaction at a time makes the first."""
    session.execute(select(Installation.id).with_for_update(key_share=True)).all()


def lock_course(session: Session, course_id: int) -> None:
    """Lock a course to the end of the transaction; submissions to it take the same lock."""
    session.execute(select(Course.id).where(Course.id == course_id).with_for_update(key_share=True)).all()


def lock_persons(session: Session, *ids: int) -> None:
    """Lock persons to the end of the transaction. Raises NoResultFound where one is gone."""
    for each in sorted(ids):
        session.execute(select(Person.id).where(Person.id == each).with_for_update(key_share=True)).one()


def lock_jobs(session: Session, *which: ColumnElement[bool]) -> None:
    """Lock the jobs of these conditions to the end of the transaction."""
    session.execute(_ordered_jobs(*which)).all()


def lock_submissions(session: Session, *which: ColumnElement[bool]) -> None:
    """Lock the submissions of these conditions to the end of the transaction.

    Whoever changes which job of a submission stands takes this lock first: a lock on jobs does not stop new ones.
    """
    query = select(SubmissionRow.id).where(*which).order_by(SubmissionRow.id)
    session.execute(query.with_for_update(key_share=True)).all()


def locked_jobs(*which: ColumnElement[bool]) -> ColumnElement[bool]:
    """Condition for an UPDATE of several jobs, which locks them in order before it changes the first."""
    return Job.id.in_(_ordered_jobs(*which))


def _ordered_jobs(*which: ColumnElement[bool]) -> Select[str]:
    return select(Job.id).where(*which).order_by(Job.id).with_for_update(key_share=True)
