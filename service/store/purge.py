"""Removes what was submitted before a day and has long been marked: submissions, grades, recordings, and their people.

What is done to a batch before that is ``batch_control.py``'s; the audit trail stays.
"""

from __future__ import annotations

from dataclasses import dataclass
from datetime import datetime

from sqlalchemy import Column, Integer, MetaData, Table, delete, func, insert, or_, select, update
from sqlalchemy.orm import Session, aliased

from service.store import audit
from service.store.engine import Store
from service.store.models import AssignmentVersion, Batch, Enrolment, Extension, Job, Person, SubmissionRow
from service.store.states import UNFINISHED
from service.store.web_tables import Appeal, Comment, OpenAssignment, Override, Tryout

_TEMPORARY = MetaData()
#: Submissions and enrolments that go; there may be more of them than a statement takes as values.
_GOING = Table("going", _TEMPORARY, Column("id", Integer, primary_key=True), prefixes=["TEMPORARY"])
_LEAVING = Table("leaving", _TEMPORARY, Column("id", Integer, primary_key=True), prefixes=["TEMPORARY"])
_AT_ONCE = 500
_going = select(_GOING.c.id)
_leaving = select(_LEAVING.c.id)


@dataclass(frozen=True, slots=True)
class Purged:
    """How much went, or would go."""

    submissions: int
    grades: int
    students: int


def purge(store: Store, before: datetime, actor: str, *, only_count: bool = False) -> Purged:
    """Remove the submissions taken in before a moment, with all that came of them, and students who have none left.

    What still waits or runs stays, and so does what a later grade is a copy of. With ``only_count`` nothing is changed.
    """
    with store.transaction() as session:
        _TEMPORARY.create_all(session.connection())
        _choose(session, before)
        found = Purged(
            _count(session, _GOING),
            session.scalar(select(func.count()).select_from(Job).where(Job.submission_id.in_(_going))) or 0,
            _count(session, _LEAVING),
        )
        if found.submissions and not only_count:
            _remove(session)
            detail = {"submissions": found.submissions, "grades": found.grades, "students": found.students}
            audit.note(session, actor, "purged", "submission", f"before {before.isoformat()}", **detail)
        _TEMPORARY.drop_all(session.connection())
        return found


def _choose(session: Session, before: datetime) -> None:
    unfinished = select(Job.submission_id).where(Job.state.in_(UNFINISHED))
    old = select(SubmissionRow.id).where(SubmissionRow.created_at < before, SubmissionRow.id.not_in(unfinished))
    session.execute(insert(_GOING).from_select(["id"], old))
    source = aliased(Job)
    needed = (
        select(source.submission_id)
        .join(Job, or_(Job.copied_from == source.id, Job.regrade_of == source.id))
        .where(Job.submission_id.not_in(_going))
    )
    # What is kept for a later grade may need an earlier one itself.
    while session.execute(delete(_GOING).where(_GOING.c.id.in_(needed))).rowcount:  # type: ignore[attr-defined]
        pass
    losing = select(SubmissionRow.enrolment_id).where(SubmissionRow.id.in_(_going))
    keeping = select(SubmissionRow.enrolment_id).where(SubmissionRow.id.not_in(_going))
    session.execute(insert(_LEAVING).from_select(["id"], losing.except_(keeping)))


def _remove(session: Session) -> None:
    of_them = Job.submission_id.in_(_going)
    session.execute(update(Job).where(of_them).values(copied_from=None, regrade_of=None))
    # Its trials, results and artifacts go with a job.
    session.execute(delete(Job).where(of_them))
    for table in (Override, Comment, Appeal):
        session.execute(delete(table).where(table.submission_id.in_(_going)))
    session.execute(delete(SubmissionRow).where(SubmissionRow.id.in_(_going)))
    used = (
        Batch.id.in_(select(Job.batch_id).where(Job.batch_id.is_not(None))),
        Batch.id.in_(select(SubmissionRow.batch_id).where(SubmissionRow.batch_id.is_not(None))),
    )
    # A batch of regrades goes before the one that it is of.
    session.execute(delete(Batch).where(~or_(*used), Batch.regrade_of.is_not(None)))
    regraded = select(Batch.regrade_of).where(Batch.regrade_of.is_not(None))
    session.execute(delete(Batch).where(~or_(*used), Batch.id.not_in(regraded)))
    needed = (Job.assignment_version_id, OpenAssignment.assignment_version_id, Tryout.assignment_version_id)
    session.execute(delete(AssignmentVersion).where(*(AssignmentVersion.id.not_in(select(each)) for each in needed)))
    people = list(session.scalars(select(Enrolment.person_id).where(Enrolment.id.in_(_leaving))))
    session.execute(delete(Extension).where(Extension.enrolment_id.in_(_leaving)))
    session.execute(delete(Tryout).where(Tryout.enrolment_id.in_(_leaving)))
    session.execute(delete(Enrolment).where(Enrolment.id.in_(_leaving)))
    in_a_course = select(Enrolment.person_id)
    for start in range(0, len(people), _AT_ONCE):
        some = Person.id.in_(people[start : start + _AT_ONCE])
        session.execute(delete(Person).where(some, Person.id.not_in(in_a_course)))


def _count(session: Session, table: Table) -> int:
    return session.scalar(select(func.count()).select_from(table)) or 0
