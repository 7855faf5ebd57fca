"""Purge of old, graded submissions, and erasure of single students.

Grades, recordings and comments are removed with their submissions. ``batch_control.py`` controls batches before that.
The activity log is kept, without the names of erased students.
"""

from __future__ import annotations

from collections.abc import Set
from dataclasses import dataclass
from datetime import datetime

from sqlalchemy import Column, Integer, MetaData, Select, Table, and_, delete, func, insert, or_, select, update
from sqlalchemy.orm import Session, aliased

from service.store import audit
from service.store.engine import Store, now, retry_conflicts
from service.store.locks import lock_for_deletion, lock_jobs, lock_submissions
from service.store.statement_log import erase_entries
from service.store.states import UNFINISHED, JobState, Role
from service.store.tables.courses import AssignmentVersion, Extension, OpenAssignment
from service.store.tables.grades import Appeal, Comment, Override
from service.store.tables.installation import Audit, IdempotentReply
from service.store.tables.people import Credential, Enrolment, LtiPerson, Person
from service.store.tables.submissions import Batch, Job, SubmissionRow, Tryout
from sim.errors import UsageError
from submissions.student_names import normalise_name

_TEMPORARY = MetaData()
#: Ids of submissions and enrolments to remove; there may be more than a statement accepts as parameters.
_MARKED_SUBMISSIONS = Table("going", _TEMPORARY, Column("id", Integer, primary_key=True), prefixes=["TEMPORARY"])
_MARKED_ENROLMENTS = Table("leaving", _TEMPORARY, Column("id", Integer, primary_key=True), prefixes=["TEMPORARY"])
_CHUNK_SIZE = 500
_ERASED = "erased"
_marked_submission_ids = select(_MARKED_SUBMISSIONS.c.id)
_marked_enrolment_ids = select(_MARKED_ENROLMENTS.c.id)


@dataclass(frozen=True, slots=True)
class PurgeCounts:
    """Numbers of removed rows, or of rows that would be removed."""

    submissions: int
    grades: int
    students: int


@retry_conflicts
def purge_submissions(
    store: Store, cutoff: datetime, actor: str, *, course_id: int | None = None, only_count: bool = False
) -> PurgeCounts:
    """Remove the submissions accepted before a moment, with their results, and students without remaining submissions.

    Applies to all courses or to one. Unfinished submissions and the sources of later copies are kept. With
    ``only_count`` nothing is changed.
    """
    with store.transaction() as session:
        _TEMPORARY.create_all(session.connection())
        _mark_old_submissions(session, cutoff, course_id)
        if not only_count:
            # Others may have added or claimed jobs meanwhile. From now on, they wait.
            lock_for_deletion(session, SubmissionRow.id, SubmissionRow.id.in_(_marked_submission_ids))
            lock_for_deletion(session, Job.id, Job.submission_id.in_(_marked_submission_ids))
        _unmark_needed_submissions(session)
        _mark_leaving_enrolments(session)
        if not only_count:
            lock_for_deletion(session, Enrolment.id, Enrolment.id.in_(_marked_enrolment_ids))
            session.execute(delete(_MARKED_ENROLMENTS).where(_MARKED_ENROLMENTS.c.id.in_(_select_keeping_enrolments())))
        counts = _count_marked_rows(session)
        if counts.submissions and not only_count:
            _delete_marked(session)
            detail = {"submissions": counts.submissions, "grades": counts.grades, "students": counts.students}
            audit.record_action(session, actor, "purged", "submission", f"before {cutoff.isoformat()}", **detail)
        _TEMPORARY.drop_all(session.connection())
        return counts


def remove_student(session: Session, enrolment_id: int, actor: str) -> None:
    """Remove a student without submissions from a course.

    Raises UsageError for an instructor or existing submissions.
    """
    if has_submitted(session, enrolment_id):
        student = session.get_one(Enrolment, enrolment_id).student
        raise UsageError(f"{student} has submissions; to delete them too, use robomark course delete-student")
    erase_student(session, enrolment_id, actor)


def has_submitted(session: Session, enrolment_id: int, ignored_assignments: Set[str] = frozenset()) -> bool:
    """Return whether a student has submitted anything, except to the assignments in ``ignored_assignments``."""
    own_submissions = select(SubmissionRow.id).where(
        SubmissionRow.enrolment_id == enrolment_id, SubmissionRow.assignment.not_in(ignored_assignments)
    )
    return session.scalar(own_submissions.limit(1)) is not None


def erase_student(session: Session, enrolment_id: int, actor: str) -> PurgeCounts:
    """Remove all data of one student of a course: submissions, results and personal data.

    A person with other courses is removed only from this one. Grades copied from the student's are kept. The caller
    must have locked the course. Raises UsageError for an instructor, and while a submission of the student is being
    graded.
    """
    enrolment = session.get_one(Enrolment, enrolment_id)
    if enrolment.role is not Role.STUDENT:
        raise UsageError(f"{enrolment.student} is not a student of this course")
    is_running = (Job.enrolment_id == enrolment_id, Job.state == JobState.RUNNING)
    if session.scalar(select(Job.id).where(*is_running).limit(1)) is not None:
        raise UsageError(
            f"a submission of {enrolment.student} is being graded; wait until grading is completed, or cancel it"
        )
    _TEMPORARY.create_all(session.connection())
    own_submissions = select(SubmissionRow.id).where(SubmissionRow.enrolment_id == enrolment_id)
    session.execute(insert(_MARKED_SUBMISSIONS).from_select(["id"], own_submissions))
    session.execute(insert(_MARKED_ENROLMENTS).values(id=enrolment_id))
    counts = _count_marked_rows(session)
    _erase_names(session, enrolment)
    _delete_replies(session, enrolment.course_id)
    _delete_marked(session)
    detail = {"submissions": counts.submissions, "grades": counts.grades}
    audit.record_action(session, actor, "erased", "enrolment", str(enrolment_id), **detail)
    _TEMPORARY.drop_all(session.connection())
    return counts


def _count_marked_rows(session: Session) -> PurgeCounts:
    grades = select(func.count()).select_from(Job).where(Job.submission_id.in_(_marked_submission_ids))
    return PurgeCounts(
        _count_rows(session, _MARKED_SUBMISSIONS), session.scalar(grades) or 0, _count_rows(session, _MARKED_ENROLMENTS)
    )


def _erase_names(session: Session, enrolment: Enrolment) -> None:
    """Remove a student's name from other rows: rejections of batches, and the activity log."""
    for batch in session.scalars(select(Batch).where(Batch.course_id == enrolment.course_id)):
        kept_refusals = [each for each in batch.refusals if normalise_name(each["student"]["id"]) != enrolment.student]
        if len(kept_refusals) < len(batch.refusals):
            batch.refusals = kept_refusals
    is_course_entry = (Audit.subject == "course", Audit.subject_id == str(enrolment.course_id))
    for row in session.scalars(select(Audit).where(*is_course_entry)):
        if row.detail.get("student") == enrolment.student:
            row.detail = {**row.detail, "student": _ERASED}
    is_actor = Audit.actor.endswith(f"(person {enrolment.person_id})", autoescape=True)
    session.execute(update(Audit).where(is_actor).values(actor=f"{_ERASED} (person {enrolment.person_id})"))


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


def _mark_old_submissions(session: Session, cutoff: datetime, course_id: int | None) -> None:
    old_submissions = select(SubmissionRow.id).where(
        SubmissionRow.created_at < cutoff, SubmissionRow.id.not_in(_select_unfinished_submissions())
    )
    if course_id is not None:
        course_enrolments = select(Enrolment.id).where(Enrolment.course_id == course_id)
        old_submissions = old_submissions.where(SubmissionRow.enrolment_id.in_(course_enrolments))
    session.execute(insert(_MARKED_SUBMISSIONS).from_select(["id"], old_submissions))


def _select_unfinished_submissions() -> Select[int]:
    return select(Job.submission_id).where(Job.state.in_(UNFINISHED))


def _unmark_needed_submissions(session: Session) -> None:
    """Keep submissions with an unfinished job, and the sources of grades that are kept."""
    is_unfinished = _MARKED_SUBMISSIONS.c.id.in_(_select_unfinished_submissions())
    session.execute(delete(_MARKED_SUBMISSIONS).where(is_unfinished))
    source = aliased(Job)
    needed_ids = (
        select(source.submission_id)
        .join(Job, or_(Job.copied_from == source.id, Job.regrade_of == source.id))
        .where(Job.submission_id.not_in(_marked_submission_ids))
    )
    # The source of a kept copy may be a copy itself.
    while session.execute(delete(_MARKED_SUBMISSIONS).where(_MARKED_SUBMISSIONS.c.id.in_(needed_ids))).rowcount:  # type: ignore[attr-defined]
        pass


def _mark_leaving_enrolments(session: Session) -> None:
    losing_enrolments = (
        select(SubmissionRow.enrolment_id)
        .join(Enrolment, SubmissionRow.enrolment_id == Enrolment.id)
        .where(SubmissionRow.id.in_(_marked_submission_ids), Enrolment.role == Role.STUDENT)
    )
    leaving_enrolments = losing_enrolments.except_(_select_keeping_enrolments())
    session.execute(insert(_MARKED_ENROLMENTS).from_select(["id"], leaving_enrolments))


def _select_keeping_enrolments() -> Select[int]:
    return select(SubmissionRow.enrolment_id).where(SubmissionRow.id.not_in(_marked_submission_ids))


def _delete_marked(session: Session) -> None:
    is_marked = Job.submission_id.in_(_marked_submission_ids)
    marked_jobs = select(Job.id).where(is_marked)
    is_marked_or_copy = or_(is_marked, Job.copied_from.in_(marked_jobs))
    lock_submissions(session, SubmissionRow.id.in_(_marked_submission_ids))
    lock_jobs(session, is_marked_or_copy)
    session.execute(update(Job).where(is_marked_or_copy).values(copied_from=None))
    session.execute(update(Job).where(is_marked).values(regrade_of=None))
    erase_entries(session, _marked_submission_ids)
    # Deleting a job also deletes its trials, results and artifacts.
    session.execute(delete(Job).where(is_marked))
    for column in (Override.submission_id, Comment.submission_id, Appeal.submission_id):
        session.execute(delete(column.class_).where(column.in_(_marked_submission_ids)))
    session.execute(delete(SubmissionRow).where(SubmissionRow.id.in_(_marked_submission_ids)))
    is_used_batch = (
        Batch.id.in_(select(Job.batch_id).where(Job.batch_id.is_not(None))),
        Batch.id.in_(select(SubmissionRow.batch_id).where(SubmissionRow.batch_id.is_not(None))),
        Batch.id.in_(select(OpenAssignment.batch_id).where(OpenAssignment.batch_id.is_not(None))),
    )
    # A batch of regrades is deleted before its original.
    session.execute(delete(Batch).where(~or_(*is_used_batch), Batch.regrade_of.is_not(None)))
    regraded_batches = select(Batch.regrade_of).where(Batch.regrade_of.is_not(None))
    session.execute(delete(Batch).where(~or_(*is_used_batch), Batch.id.not_in(regraded_batches)))
    person_ids = list(session.scalars(select(Enrolment.person_id).where(Enrolment.id.in_(_marked_enrolment_ids))))
    for column in (Extension.enrolment_id, Tryout.enrolment_id):
        session.execute(delete(column.class_).where(column.in_(_marked_enrolment_ids)))
    version_queries = [select(table.assignment_version_id) for table in (Job, OpenAssignment, Tryout)]
    session.execute(delete(AssignmentVersion).where(*(AssignmentVersion.id.not_in(each) for each in version_queries)))
    _sign_out_marked(session)
    session.execute(delete(Enrolment).where(Enrolment.id.in_(_marked_enrolment_ids)))
    enrolled_ids = select(Enrolment.person_id)
    for start in range(0, len(person_ids), _CHUNK_SIZE):
        is_unenrolled = (
            Person.id.in_(person_ids[start : start + _CHUNK_SIZE]),
            Person.id.not_in(enrolled_ids),
            ~Person.operator,
        )
        removed_ids = select(Person.id).where(*is_unenrolled)
        credential_ids = select(Credential.id).where(Credential.person_id.in_(removed_ids))
        session.execute(delete(IdempotentReply).where(IdempotentReply.credential_id.in_(credential_ids)))
        for column in (Credential.person_id, LtiPerson.person_id):
            session.execute(delete(column.class_).where(column.in_(removed_ids)))
        session.execute(delete(Person).where(*is_unenrolled))


def _sign_out_marked(session: Session) -> None:
    """Revoke the credentials of students who leave a course, if they reach that course."""
    has_reach = or_(Credential.course_id.is_(None), Credential.course_id == Enrolment.course_id)
    leaving_enrolments = select(Enrolment.id).where(
        Enrolment.id.in_(_marked_enrolment_ids), Enrolment.person_id == Credential.person_id, has_reach
    )
    statement = (
        update(Credential)
        .where(Credential.revoked_at.is_(None), leaving_enrolments.exists())
        .values(revoked_at=now(session))
    )
    session.execute(statement.execution_options(synchronize_session=False))


def _count_rows(session: Session, table: Table) -> int:
    return session.scalar(select(func.count()).select_from(table)) or 0
