"""Purge of old, graded submissions, and erasure of single students.

Grades, recordings and comments are removed with their submissions. ``batch_control.py`` controls batches before that.
The activity log is kept, without the names of erased students.
"""

from __future__ import annotations

from collections.abc import Set
from dataclasses import dataclass
from datetime import datetime

from sqlalchemy import Column, Integer, MetaData, Table, and_, delete, func, insert, or_, select, update
from sqlalchemy.orm import Session, aliased

from service.store import audit
from service.store.engine import Store, now, retry_conflicts
from service.store.locks import lock_jobs, lock_submissions
from service.store.models import AssignmentVersion, Audit, Batch, Enrolment, Extension, Job, Person, SubmissionRow
from service.store.states import UNFINISHED, JobState, Role
from service.store.web_tables import (
    Appeal,
    Comment,
    Credential,
    IdempotentReply,
    LtiPerson,
    OpenAssignment,
    Override,
    Tryout,
)
from sim.errors import UsageError
from submissions.student_names import normalise_name

_TEMPORARY = MetaData()
#: Ids of submissions and enrolments to remove; there may be more than a statement accepts as parameters.
_GOING = Table("going", _TEMPORARY, Column("id", Integer, primary_key=True), prefixes=["TEMPORARY"])
_LEAVING = Table("leaving", _TEMPORARY, Column("id", Integer, primary_key=True), prefixes=["TEMPORARY"])
_AT_ONCE = 500
_ERASED = "erased"
_going = select(_GOING.c.id)
_leaving = select(_LEAVING.c.id)


@dataclass(frozen=True, slots=True)
class PurgeCounts:
    """Numbers of removed rows, or of rows that would be removed."""

    submissions: int
    grades: int
    students: int


@retry_conflicts
def purge_submissions(
    store: Store, before: datetime, actor: str, *, course_id: int | None = None, only_count: bool = False
) -> PurgeCounts:
    """Remove the submissions accepted before a moment, with their results, and students without remaining submissions.

    Applies to all courses or to one. Unfinished submissions and the sources of later copies are kept. With
    ``only_count`` nothing is changed.
    """
    with store.transaction() as session:
        _TEMPORARY.create_all(session.connection())
        _mark_old_submissions(session, before, course_id)
        found = _count_marked_rows(session)
        if found.submissions and not only_count:
            _delete_marked(session)
            detail = {"submissions": found.submissions, "grades": found.grades, "students": found.students}
            audit.record_action(session, actor, "purged", "submission", f"before {before.isoformat()}", **detail)
        _TEMPORARY.drop_all(session.connection())
        return found


def remove_student(session: Session, enrolment_id: int, actor: str) -> None:
    """Remove a student without submissions from a course.

    Raises UsageError for an instructor or existing submissions.
    """
    if has_submitted(session, enrolment_id):
        student = session.get_one(Enrolment, enrolment_id).student
        raise UsageError(f"{student} has submissions; to delete them too, use robomark course delete-student")
    erase_student(session, enrolment_id, actor)


def has_submitted(session: Session, enrolment_id: int, without: Set[str] = frozenset()) -> bool:
    """Return whether a student has submitted anything, except to the assignments in ``without``."""
    own = select(SubmissionRow.id).where(
        SubmissionRow.enrolment_id == enrolment_id, SubmissionRow.assignment.not_in(without)
    )
    return session.scalar(own.limit(1)) is not None


def erase_student(session: Session, enrolment_id: int, actor: str) -> PurgeCounts:
    """Remove all data of one student of a course: submissions, results and personal data.

    A person with other courses is removed only from this one. Grades copied from the student's are kept. The caller
    must have locked the course. Raises UsageError for an instructor, and while a submission of the student is being
    graded.
    """
    enrolment = session.get_one(Enrolment, enrolment_id)
    if enrolment.role is not Role.STUDENT:
        raise UsageError(f"{enrolment.student} is not a student of this course")
    running = (Job.enrolment_id == enrolment_id, Job.state == JobState.RUNNING)
    if session.scalar(select(Job.id).where(*running).limit(1)) is not None:
        raise UsageError(
            f"a submission of {enrolment.student} is being graded; wait until grading is completed, or cancel it"
        )
    _TEMPORARY.create_all(session.connection())
    own = select(SubmissionRow.id).where(SubmissionRow.enrolment_id == enrolment_id)
    session.execute(insert(_GOING).from_select(["id"], own))
    session.execute(insert(_LEAVING).values(id=enrolment_id))
    found = _count_marked_rows(session)
    _erase_names(session, enrolment)
    _delete_replies(session, enrolment.course_id)
    _delete_marked(session)
    detail = {"submissions": found.submissions, "grades": found.grades}
    audit.record_action(session, actor, "erased", "enrolment", str(enrolment_id), **detail)
    _TEMPORARY.drop_all(session.connection())
    return found


def _count_marked_rows(session: Session) -> PurgeCounts:
    grades = select(func.count()).select_from(Job).where(Job.submission_id.in_(_going))
    return PurgeCounts(_count_rows(session, _GOING), session.scalar(grades) or 0, _count_rows(session, _LEAVING))


def _erase_names(session: Session, enrolment: Enrolment) -> None:
    """Remove a student's name from other rows: rejections of batches, and the activity log."""
    for batch in session.scalars(select(Batch).where(Batch.course_id == enrolment.course_id)):
        kept = [each for each in batch.refusals if normalise_name(each["student"]["id"]) != enrolment.student]
        if len(kept) < len(batch.refusals):
            batch.refusals = kept
    of_course = (Audit.subject == "course", Audit.subject_id == str(enrolment.course_id))
    for row in session.scalars(select(Audit).where(*of_course)):
        if row.detail.get("student") == enrolment.student:
            row.detail = {**row.detail, "student": _ERASED}
    by_them = Audit.actor.endswith(f"(person {enrolment.person_id})", autoescape=True)
    session.execute(update(Audit).where(by_them).values(actor=f"{_ERASED} (person {enrolment.person_id})"))


def _delete_replies(session: Session, course_id: int) -> None:
    """Delete the stored replies to requests about a course, which may contain the names of students and files."""
    members = select(Enrolment.person_id).where(Enrolment.course_id == course_id)
    operators = select(Person.id).where(Person.operator)
    unlimited = and_(
        Credential.course_id.is_(None), or_(Credential.person_id.in_(members), Credential.person_id.in_(operators))
    )
    reaching = select(Credential.id).where(or_(Credential.course_id == course_id, unlimited))
    # A reply without a status belongs to a request in progress, and is empty.
    complete = (IdempotentReply.status > 0, IdempotentReply.credential_id.in_(reaching))
    session.execute(delete(IdempotentReply).where(*complete))


def _mark_old_submissions(session: Session, before: datetime, course_id: int | None) -> None:
    unfinished = select(Job.submission_id).where(Job.state.in_(UNFINISHED))
    old = select(SubmissionRow.id).where(SubmissionRow.created_at < before, SubmissionRow.id.not_in(unfinished))
    if course_id is not None:
        of_course = select(Enrolment.id).where(Enrolment.course_id == course_id)
        old = old.where(SubmissionRow.enrolment_id.in_(of_course))
    session.execute(insert(_GOING).from_select(["id"], old))
    source = aliased(Job)
    needed = (
        select(source.submission_id)
        .join(Job, or_(Job.copied_from == source.id, Job.regrade_of == source.id))
        .where(Job.submission_id.not_in(_going))
    )
    # The source of a kept copy may be a copy itself.
    while session.execute(delete(_GOING).where(_GOING.c.id.in_(needed))).rowcount:  # type: ignore[attr-defined]
        pass
    losing = select(SubmissionRow.enrolment_id).where(SubmissionRow.id.in_(_going))
    keeping = select(SubmissionRow.enrolment_id).where(SubmissionRow.id.not_in(_going))
    session.execute(insert(_LEAVING).from_select(["id"], losing.except_(keeping)))


def _delete_marked(session: Session) -> None:
    of_them = Job.submission_id.in_(_going)
    theirs = select(Job.id).where(of_them)
    copies = or_(of_them, Job.copied_from.in_(theirs))
    lock_submissions(session, SubmissionRow.id.in_(_going))
    lock_jobs(session, copies)
    session.execute(update(Job).where(copies).values(copied_from=None))
    session.execute(update(Job).where(of_them).values(regrade_of=None))
    # Deleting a job also deletes its trials, results and artifacts.
    session.execute(delete(Job).where(of_them))
    for column in (Override.submission_id, Comment.submission_id, Appeal.submission_id):
        session.execute(delete(column.class_).where(column.in_(_going)))
    session.execute(delete(SubmissionRow).where(SubmissionRow.id.in_(_going)))
    used = (
        Batch.id.in_(select(Job.batch_id).where(Job.batch_id.is_not(None))),
        Batch.id.in_(select(SubmissionRow.batch_id).where(SubmissionRow.batch_id.is_not(None))),
        Batch.id.in_(select(OpenAssignment.batch_id).where(OpenAssignment.batch_id.is_not(None))),
    )
    # A batch of regrades is deleted before its original.
    session.execute(delete(Batch).where(~or_(*used), Batch.regrade_of.is_not(None)))
    regraded = select(Batch.regrade_of).where(Batch.regrade_of.is_not(None))
    session.execute(delete(Batch).where(~or_(*used), Batch.id.not_in(regraded)))
    people = list(session.scalars(select(Enrolment.person_id).where(Enrolment.id.in_(_leaving))))
    for column in (Extension.enrolment_id, Tryout.enrolment_id):
        session.execute(delete(column.class_).where(column.in_(_leaving)))
    needed = [select(table.assignment_version_id) for table in (Job, OpenAssignment, Tryout)]
    session.execute(delete(AssignmentVersion).where(*(AssignmentVersion.id.not_in(each) for each in needed)))
    _sign_out_leaving(session)
    session.execute(delete(Enrolment).where(Enrolment.id.in_(_leaving)))
    in_a_course = select(Enrolment.person_id)
    for start in range(0, len(people), _AT_ONCE):
        some = (Person.id.in_(people[start : start + _AT_ONCE]), Person.id.not_in(in_a_course), ~Person.operator)
        gone = select(Person.id).where(*some)
        secrets = select(Credential.id).where(Credential.person_id.in_(gone))
        session.execute(delete(IdempotentReply).where(IdempotentReply.credential_id.in_(secrets)))
        for column in (Credential.person_id, LtiPerson.person_id):
            session.execute(delete(column.class_).where(column.in_(gone)))
        session.execute(delete(Person).where(*some))


def _sign_out_leaving(session: Session) -> None:
    """Revoke the credentials of students who leave a course, if they reach that course."""
    reaches = or_(Credential.course_id.is_(None), Credential.course_id == Enrolment.course_id)
    left = select(Enrolment.id).where(Enrolment.id.in_(_leaving), Enrolment.person_id == Credential.person_id, reaches)
    ended = update(Credential).where(Credential.revoked_at.is_(None), left.exists()).values(revoked_at=now(session))
    session.execute(ended.execution_options(synchronize_session=False))


def _count_rows(session: Session, table: Table) -> int:
    return session.scalar(select(func.count()).select_from(table)) or 0
