"""Row locks. Several rows are locked in the order of their ids, so that transactions do not deadlock.

They are ``FOR NO KEY UPDATE``, so PostgreSQL can check foreign keys to the locked rows, except before a deletion.
SQLite allows one writer at a time and ignores them.
"""

from __future__ import annotations

from typing import Any

from sqlalchemy import ColumnElement, Select, select
from sqlalchemy.orm import InstrumentedAttribute, Session

from service.store.tables.courses import Course
from service.store.tables.installation import Installation
from service.store.tables.people import Person
from service.store.tables.submissions import Job, SubmissionRow


def lock_installation(session: Session) -> None:
    """Lock the installation row, so that only one transaction at a time creates an object that must be unique."""
    session.execute(select(Installation.id).with_for_update(key_share=True)).all()


def lock_course(session: Session, course_id: int) -> None:
    """Lock a course until the end of the transaction; submissions to it take the same lock."""
    session.execute(select(Course.id).where(Course.id == course_id).with_for_update(key_share=True)).all()


def lock_persons(session: Session, *ids: int) -> None:
    """Lock persons until the end of the transaction. Raises NoResultFound if one no longer exists."""
    for person_id in sorted(ids):
        session.execute(select(Person.id).where(Person.id == person_id).with_for_update(key_share=True)).one()


def lock_jobs(session: Session, *conditions: ColumnElement[bool]) -> None:
    """Lock the jobs that match these conditions until the end of the transaction."""
    session.execute(_select_jobs_for_update(*conditions)).all()


def lock_submissions(session: Session, *conditions: ColumnElement[bool]) -> None:
    """Lock the submissions that match these conditions until the end of the transaction.

    Take this lock before changing the standing job of a submission: a lock on jobs does not stop new ones.
    """
    query = select(SubmissionRow.id).where(*conditions).order_by(SubmissionRow.id)
    session.execute(query.with_for_update(key_share=True)).all()


def lock_for_deletion(session: Session, key: InstrumentedAttribute[Any], condition: ColumnElement[bool]) -> None:
    """Lock the rows that match the condition. Until the end of the transaction, no row that refers to them is added."""
    session.execute(select(key).where(condition).order_by(key).with_for_update()).all()


def match_and_lock_jobs(*conditions: ColumnElement[bool]) -> ColumnElement[bool]:
    """Return a condition for an UPDATE of several jobs, which locks them in order before the first change."""
    return Job.id.in_(_select_jobs_for_update(*conditions))


def _select_jobs_for_update(*conditions: ColumnElement[bool]) -> Select[str]:
    return select(Job.id).where(*conditions).order_by(Job.id).with_for_update(key_share=True)
