"""Takes hand-ins in: the student, the frozen assignment, the submission and its job, in one transaction.

Publishes nothing: the row is the job, and the queue's nudge comes after the commit.
"""

from __future__ import annotations

import hashlib
import json
import zlib
from collections.abc import Sequence
from dataclasses import dataclass
from datetime import datetime

from sqlalchemy import func, select, update
from sqlalchemy.dialects import postgresql, sqlite
from sqlalchemy.orm import Session

from service.store import models
from service.store.engine import Store, now
from service.store.models import (
    AssignmentVersion,
    Batch,
    BatchState,
    Course,
    Enrolment,
    Job,
    JobState,
    Lane,
    Person,
    Role,
    new_id,
)
from service.store.plain import from_plain, to_plain
from sim.errors import HostError, UsageError
from submissions.assignment import Assignment
from submissions.bundle import pack_submission, unpack_submission
from submissions.submission import Submission

DEFAULT_COURSE = "default"


@dataclass(frozen=True, slots=True)
class HandIn:
    """One submission and what it is marked against; ``source`` is the name it came under."""

    submission: Submission
    assignment: Assignment
    source: str


@dataclass(frozen=True, slots=True)
class Accepted:
    """A hand-in that is now a job."""

    job_id: str
    student: str
    attempt: int


@dataclass(frozen=True, slots=True)
class AcceptedBatch:
    id: str
    jobs: tuple[Accepted, ...]


@dataclass(frozen=True, slots=True)
class Known:
    """A hand-in that changes nothing: the newest of its student is the same, for the same assignment."""

    job_id: str
    batch_id: str | None
    student: str
    state: JobState


@dataclass(frozen=True, slots=True)
class AcceptedNew:
    """What was new of a batch, and what was not; no batch was made when nothing was."""

    batch: AcceptedBatch | None
    known: tuple[Known, ...]


def accept(
    store: Store, hand_in: HandIn, *, course: str = DEFAULT_COURSE, max_attempts: int, lane: Lane = Lane.INTERACTIVE
) -> Accepted:
    """Take in one hand-in that a person waits for."""
    (packed,) = _pack([hand_in])
    with store.transaction() as session:
        at = now(session)
        course_id = _course(session, course, at)
        return _accept(session, packed, course_id, None, lane, max_attempts, at)


def accept_batch(
    store: Store,
    name: str,
    hand_ins: Sequence[HandIn],
    problems: Sequence[tuple[str, str]],
    *,
    course: str = DEFAULT_COURSE,
    max_attempts: int,
) -> AcceptedBatch:
    """Take in a whole batch or nothing of it, each hand-in as a new one whatever was handed in before.

    ``problems`` are the rows that were refused: name, sentence.
    """
    packed = _pack(hand_ins)
    with store.transaction() as session:
        at = now(session)
        course_id = _course(session, course, at)
        return _accept_batch(session, packed, course_id, name, problems, max_attempts, at)


def accept_new(
    store: Store,
    name: str,
    hand_ins: Sequence[HandIn],
    problems: Sequence[tuple[str, str]],
    *,
    course: str = DEFAULT_COURSE,
    max_attempts: int,
) -> AcceptedNew:
    """Take in what is new of a batch, so that handing in the same batch twice changes nothing.

    Not new is what has the bytes of the student's newest hand-in and is marked against the same version of the
    assignment; but for what was cancelled, which comes in again.
    """
    packed = _pack(hand_ins)
    with store.transaction() as session:
        at = now(session)
        course_id = _course(session, course, at)
        found = [_known(session, item, course_id) for item in packed]
        new = [item for item, known in zip(packed, found, strict=True) if known is None]
        batch = _accept_batch(session, new, course_id, name, problems, max_attempts, at) if new else None
        return AcceptedNew(batch, tuple(known for known in found if known is not None))


def load_hand_in(session: Session, job_id: str) -> HandIn:
    """What a job is about, rebuilt from the database alone.

    Raises UsageError for an unknown job, HostError where what was kept cannot be read.
    """
    query = (
        select(models.Submission.packed, models.Submission.source, AssignmentVersion.content)
        .join(Job, Job.submission_id == models.Submission.id)
        .join(AssignmentVersion, Job.assignment_version_id == AssignmentVersion.id)
        .where(Job.id == job_id)
    )
    found = session.execute(query).one_or_none()
    if found is None:
        raise UsageError(f"there is no job {job_id}")
    packed, source, content = found
    try:
        return HandIn(unpack_submission(packed), assignment_from_bytes(content), source)
    except (UsageError, ValueError, TypeError, KeyError) as error:
        raise HostError(f"The hand-in of {job_id} cannot be read back: {error}") from error


def assignment_to_bytes(assignment: Assignment) -> bytes:
    """All of an assignment, pictures and given files and secret included."""
    text = json.dumps(to_plain(assignment), sort_keys=True, separators=(",", ":"))
    return zlib.compress(text.encode("ascii"), 6)


def assignment_from_bytes(content: bytes) -> Assignment:
    """The assignment again. Raises ValueError or TypeError if the bytes are not one."""
    try:
        return from_plain(Assignment, json.loads(zlib.decompress(content)))
    except zlib.error as error:
        raise ValueError(f"not an assignment: {error}") from error


@dataclass(frozen=True, slots=True)
class _Packed:
    hand_in: HandIn
    data: bytes
    content: bytes  # of the assignment
    content_sha256: str


def _pack(hand_ins: Sequence[HandIn]) -> list[_Packed]:
    """What is stored of each hand-in; done before the transaction, and once for each assignment."""
    contents: dict[int, tuple[bytes, str]] = {}
    packed = []
    for hand_in in hand_ins:
        key = id(hand_in.assignment)
        if key not in contents:
            content = assignment_to_bytes(hand_in.assignment)
            contents[key] = content, hashlib.sha256(zlib.decompress(content)).hexdigest()
        packed.append(_Packed(hand_in, pack_submission(hand_in.submission), *contents[key]))
    return packed


def _known(session: Session, packed: _Packed, course_id: int) -> Known | None:
    submission, assignment = packed.hand_in.submission, packed.hand_in.assignment
    query = (
        select(models.Submission.sha256, AssignmentVersion.sha256, Job.id, Job.state, Job.batch_id, Batch.state)
        .join(Enrolment, models.Submission.enrolment_id == Enrolment.id)
        .join(Job, Job.submission_id == models.Submission.id)
        .join(AssignmentVersion, Job.assignment_version_id == AssignmentVersion.id)
        .outerjoin(Batch, Job.batch_id == Batch.id)
        .where(
            Enrolment.course_id == course_id,
            Enrolment.student == submission.student,
            models.Submission.assignment == assignment.id,
        )
        .order_by(models.Submission.attempt.desc(), Job.queued_at.desc(), Job.id)
        .limit(1)
    )
    newest = session.execute(query).one_or_none()
    if newest is None:
        return None
    sha256, version, job_id, state, batch_id, batch_state = newest
    # A dead job of a cancelled batch cannot be retried, so it too comes in again.
    cancelled = state is JobState.CANCELLED or (state is JobState.DEAD and batch_state is BatchState.CANCELLED)
    if cancelled or (sha256, version) != (submission.sha256, packed.content_sha256):
        return None
    return Known(job_id, batch_id, submission.student, state)


def _accept_batch(
    session: Session,
    packed: Sequence[_Packed],
    course_id: int,
    name: str,
    problems: Sequence[tuple[str, str]],
    max_attempts: int,
    at: datetime,
) -> AcceptedBatch:
    batch = Batch(course_id=course_id, name=name, problems=[list(row) for row in problems], created_at=at)
    session.add(batch)
    session.flush()
    jobs = tuple(_accept(session, item, course_id, batch.id, Lane.BATCH, max_attempts, at) for item in packed)
    return AcceptedBatch(batch.id, jobs)


def _accept(
    session: Session,
    packed: _Packed,
    course_id: int,
    batch_id: str | None,
    lane: Lane,
    max_attempts: int,
    at: datetime,
) -> Accepted:
    submission, assignment = packed.hand_in.submission, packed.hand_in.assignment
    enrolment_id = _enrolment(session, course_id, submission.student, at)
    version_id = _assignment_version(session, packed, at)
    of_student = (
        models.Submission.enrolment_id == enrolment_id,
        models.Submission.assignment == assignment.id,
    )
    earlier = session.scalar(select(func.max(models.Submission.attempt)).where(*of_student)) or 0
    waiting = (
        Job.state == JobState.QUEUED,
        Job.submission_id.in_(select(models.Submission.id).where(*of_student)),
    )
    job_id = new_id()
    superseded = {"state": JobState.CANCELLED, "error": f"superseded by {job_id}", "finished_at": at}
    session.execute(update(Job).where(*waiting).values(**superseded))
    row = models.Submission(
        enrolment_id=enrolment_id,
        assignment=assignment.id,
        batch_id=batch_id,
        attempt=earlier + 1,
        sha256=submission.sha256,
        source=packed.hand_in.source,
        size=len(packed.data),
        packed=packed.data,
        created_at=at,
    )
    session.add(row)
    session.flush()
    job = Job(
        id=job_id,
        submission_id=row.id,
        assignment_version_id=version_id,
        enrolment_id=enrolment_id,
        batch_id=batch_id,
        lane=lane,
        max_attempts=max_attempts,
        due_at=at,
        queued_at=at,
    )
    session.add(job)
    session.flush()
    return Accepted(job.id, submission.student, row.attempt)


def _course(session: Session, name: str, at: datetime) -> int:
    """The course, locked to the end of the transaction: numbering attempts needs one writer at a time."""
    _insert_if_new(session, Course, name=name, created_at=at)
    return session.scalars(select(Course.id).where(Course.name == name).with_for_update()).one()


def _enrolment(session: Session, course_id: int, student: str, at: datetime) -> int:
    found = session.scalar(select(Enrolment.id).where(Enrolment.course_id == course_id, Enrolment.student == student))
    if found is not None:
        return found
    person = Person(name=student, created_at=at)
    session.add(person)
    session.flush()
    enrolment = Enrolment(course_id=course_id, person_id=person.id, student=student, role=Role.STUDENT)
    session.add(enrolment)
    session.flush()
    return enrolment.id


def _assignment_version(session: Session, packed: _Packed, at: datetime) -> int:
    of_version = select(AssignmentVersion.id).where(AssignmentVersion.sha256 == packed.content_sha256)
    found = session.scalar(of_version)
    if found is not None:
        return found
    assignment = packed.hand_in.assignment
    _insert_if_new(
        session,
        AssignmentVersion,
        assignment=assignment.id,
        sha256=packed.content_sha256,
        version=assignment.version,
        title=assignment.title,
        max_marks=assignment.max_marks,
        content=packed.content,
        created_at=at,
    )
    return session.scalars(of_version).one()


def _insert_if_new(session: Session, table: type[models.Base], **values: object) -> None:
    insert = postgresql.insert if session.get_bind().dialect.name == "postgresql" else sqlite.insert
    session.execute(insert(table).values(**values).on_conflict_do_nothing())
