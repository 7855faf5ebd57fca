"""Intake of submissions: stores student, frozen assignment, submission and job in one transaction.

Sends nothing to the broker: the row is the job, and workers are notified after the commit.
"""

from __future__ import annotations

import secrets
from collections import defaultdict
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from datetime import datetime

from sqlalchemy import ColumnElement, delete, func, select
from sqlalchemy.orm import Session

from service.store import webhook_events
from service.store.batches.known_submissions import KnownSubmission, find_known_submission
from service.store.codec import encode
from service.store.courses import open_assignments
from service.store.courses.assignment_versions import FrozenAssignment, freeze_assignment, store_version
from service.store.courses.policies import Ruling, apply_policy, match_best_counts
from service.store.engine import Store, now, retry_conflicts
from service.store.grades import result_cache
from service.store.ids import generate_id
from service.store.installation import load_secret
from service.store.locks import lock_jobs
from service.store.people.students import DEFAULT_COURSE, Students, ensure_course
from service.store.queue import jobs
from service.store.states import CancelReason, JobQueue, JobState
from service.store.tables.grades import Comment
from service.store.tables.submissions import Batch, Job, SubmissionRow
from service.version import hash_grader
from sim.errors import UsageError
from submissions.grading_request import GradingRequest
from submissions.raw_files import MEGABYTE
from submissions.stored_submission import pack_submission
from submissions.student_identity import RejectedSubmission


@dataclass(frozen=True, slots=True)
class AcceptedSubmission:
    """A submission that was accepted as a job."""

    job_id: str
    submission_id: int
    student: str
    assignment: str
    attempt: int
    copied_from: str | None = None  # the identical grade that was copied to it
    staff_only: str = ""  # the limit that it exceeds


@dataclass(frozen=True, slots=True)
class AcceptedBatch:
    """An accepted batch; ``refused`` contains students that cannot be identified uniquely in the course."""

    id: str
    jobs: tuple[AcceptedSubmission, ...]
    refused: tuple[RejectedSubmission, ...] = ()


@dataclass(frozen=True, slots=True)
class BatchIntake:
    """New and already known submissions of a batch. ``batch`` is None if nothing was new."""

    batch: AcceptedBatch | None
    known: tuple[KnownSubmission, ...]
    refused: tuple[RejectedSubmission, ...] = ()


@retry_conflicts
def accept_submission(
    store: Store,
    grading_request: GradingRequest,
    *,
    course: str = DEFAULT_COURSE,
    max_attempts: int,
    lane: JobQueue = JobQueue.INTERACTIVE,
    batch_id: str | None = None,
    max_bytes: int | None = None,
    enrolment_id: int | None = None,
) -> AcceptedSubmission:
    """Accept one interactive submission. If an identical submission is graded, its grade is copied immediately.

    Without a submission time in the request, the current time is used. Of the submissions over a limit only the newest
    is kept, ungraded until staff ask for it.

    ``max_bytes`` limits the total size of the student's submissions to the assignment; set it when students submit
    themselves. With ``enrolment_id``, the signed-in student must be enrolled under that id, and the assignment open.

    Raises UsageError if the student is ambiguous, exceeds the size limit or is no longer enrolled, or if the assignment
    is closed.
    """
    (packed_request,) = _pack_requests([grading_request])
    secret = load_secret(store).sha256
    with store.transaction() as session:
        current_time = now(session)
        packed_request = replace(
            packed_request,
            grading_request=replace(grading_request, submitted_at=grading_request.submitted_at or current_time),
        )
        terms = _IntakeTerms(
            ensure_course(session, course, current_time),
            lane,
            max_attempts,
            current_time,
            secret,
            batch_id,
            most_bytes=max_bytes,
        )
        students = Students(session, terms.course_id)
        if enrolment_id is None:
            enrolment_id = students.enrol(grading_request.student, current_time)
        elif not students.is_enrolled(enrolment_id, grading_request.student):
            raise UsageError("you are no longer a student of this course, so nothing was submitted.")
        else:
            # The lock of the course keeps it open until the submission is stored.
            opened = open_assignments.load_course_assignment(session, terms.course_id, grading_request.assignment.id)
            open_assignments.check_open(opened)
        return _accept_item(session, _IntakeItem(packed_request, enrolment_id), terms)


@retry_conflicts
def accept_batch(
    store: Store,
    name: str,
    grading_requests: Sequence[GradingRequest],
    refusals: Sequence[RejectedSubmission],
    *,
    course: str = DEFAULT_COURSE,
    max_attempts: int,
    record: Callable[[Session, BatchIntake], None] | None = None,
) -> AcceptedBatch:
    """Accept a whole batch or nothing. Each submission is graded again, regardless of earlier submissions.

    ``refusals`` were found when the batch was read. ``record`` is called with the accepted batch in the same
    transaction. Raises UsageError if all remaining submissions are rejected.
    """
    packed_requests = _pack_requests(grading_requests)
    secret = load_secret(store).sha256
    with store.transaction() as session:
        current_time = now(session)
        terms = _IntakeTerms(
            ensure_course(session, course, current_time), JobQueue.BATCH, max_attempts, current_time, secret, anew=True
        )
        items, enrolment_refusals = _enrol_students(session, packed_requests, terms)
        if enrolment_refusals and not items:
            raise UsageError(
                f"no submission can be accepted; {enrolment_refusals[0].source}: {enrolment_refusals[0].reason}"
            )
        accepted_batch = replace(
            _accept_batch(session, items, name, [*refusals, *enrolment_refusals], terms), refused=enrolment_refusals
        )
        if record is not None:
            record(session, BatchIntake(accepted_batch, (), enrolment_refusals))
        return accepted_batch


@retry_conflicts
def accept_new_submissions(
    store: Store,
    name: str,
    grading_requests: Sequence[GradingRequest],
    refusals: Sequence[RejectedSubmission],
    *,
    course: str = DEFAULT_COURSE,
    max_attempts: int,
    record: Callable[[Session, BatchIntake], None] | None = None,
) -> BatchIntake:
    """Accept the new submissions of a batch. Submitting the same batch twice changes nothing.

    A submission is known if it has the same bytes as the student's newest submission and the same assignment version.
    Cancelled submissions are accepted again. A new submission that is identical to a graded one gets that grade
    immediately. ``record`` is called in the same transaction if a batch is created.
    """
    packed_requests = _pack_requests(grading_requests)
    secret = load_secret(store).sha256
    with store.transaction() as session:
        current_time = now(session)
        terms = _IntakeTerms(
            ensure_course(session, course, current_time), JobQueue.BATCH, max_attempts, current_time, secret
        )
        items, enrolment_refusals = _enrol_students(session, packed_requests, terms)
        known_submissions = [
            find_known_submission(session, item.packed.grading_request, item.enrolment_id, item.packed.frozen.sha256)
            for item in items
        ]
        new_items = [item for item, known in zip(items, known_submissions, strict=True) if known is None]
        batch = _accept_batch(session, new_items, name, [*refusals, *enrolment_refusals], terms) if new_items else None
        batch_intake = BatchIntake(
            batch, tuple(known for known in known_submissions if known is not None), enrolment_refusals
        )
        if record is not None and batch is not None:
            record(session, batch_intake)
        return batch_intake


@dataclass(frozen=True, slots=True)
class _PackedRequest:
    grading_request: GradingRequest
    data: bytes
    frozen: FrozenAssignment


@dataclass(frozen=True, slots=True)
class _IntakeItem:
    """A submission to accept, with the enrolment of its student."""

    packed: _PackedRequest
    enrolment_id: int


@dataclass(frozen=True, slots=True)
class _IntakeTerms:
    """Conditions of an intake. With ``anew``, staff request a regrade: policies and identical grades are ignored."""

    course_id: int
    lane: JobQueue
    max_attempts: int
    at: datetime
    secret_sha256: str
    batch_id: str | None = None
    anew: bool = False
    most_bytes: int | None = None  # size limit per student and assignment; None when staff submit


def _pack_requests(grading_requests: Sequence[GradingRequest]) -> list[_PackedRequest]:
    """Prepare the stored form of each submission, before the transaction and once per assignment."""
    frozen_assignments: dict[int, FrozenAssignment] = {}
    packed_requests = []
    for grading_request in grading_requests:
        key = id(grading_request.assignment)
        if key not in frozen_assignments:
            frozen_assignments[key] = freeze_assignment(grading_request.assignment)
        packed_requests.append(
            _PackedRequest(grading_request, pack_submission(grading_request.submission), frozen_assignments[key])
        )
    return packed_requests


def _enrol_students(
    session: Session, packed_requests: Sequence[_PackedRequest], terms: _IntakeTerms
) -> tuple[list[_IntakeItem], tuple[RejectedSubmission, ...]]:
    """Return the submissions with their enrolments, and the rejections of students who are ambiguous."""
    students = Students(session, terms.course_id)
    items, refusals = [], []
    for packed_request in packed_requests:
        grading_request = packed_request.grading_request
        try:
            items.append(_IntakeItem(packed_request, students.enrol(grading_request.student, terms.at)))
        except UsageError as error:
            refusals.append(
                RejectedSubmission(
                    grading_request.source, str(error), grading_request.student, grading_request.assignment.id
                )
            )
    return items, tuple(refusals)


def _accept_batch(
    session: Session,
    items: Sequence[_IntakeItem],
    name: str,
    refusals: Sequence[RejectedSubmission],
    terms: _IntakeTerms,
) -> AcceptedBatch:
    batch = Batch(course_id=terms.course_id, name=name, refusals=encode(tuple(refusals)), created_at=terms.at)
    session.add(batch)
    session.flush()
    terms = replace(terms, batch_id=batch.id)
    # Submission numbers are in a random order, so that they identify neither the student nor the student's submissions
    # to other assignments. Repeated submissions to one assignment keep the order of the batch.
    places: defaultdict[tuple[int, str], bytes] = defaultdict(lambda: secrets.token_bytes(16))
    keys = [places[item.enrolment_id, item.packed.grading_request.assignment.id] for item in items]
    order = sorted(range(len(items)), key=keys.__getitem__)
    accepted_items = {number: _accept_item(session, items[number], terms) for number in order}
    accepted_batch = AcceptedBatch(batch.id, tuple(accepted_items[number] for number in range(len(items))))
    webhook_events.emit_batch_finished(session, batch.id)
    return accepted_batch


def _accept_item(session: Session, item: _IntakeItem, terms: _IntakeTerms) -> AcceptedSubmission:
    packed_request, enrolment_id, current_time = item.packed, item.enrolment_id, terms.at
    grading_request = packed_request.grading_request
    submission, assignment = grading_request.submission, grading_request.assignment
    version_id = store_version(session, packed_request.frozen, current_time)
    is_earlier = (SubmissionRow.enrolment_id == enrolment_id, SubmissionRow.assignment == assignment.id)
    previous_attempts = session.scalar(select(func.max(SubmissionRow.attempt)).where(*is_earlier)) or 0
    # A claim skips locked jobs: no job starts between the ruling, which counts only started jobs, and being
    # superseded.
    queued_jobs = (Job.state == JobState.QUEUED, Job.submission_id.in_(select(SubmissionRow.id).where(*is_earlier)))
    lock_jobs(session, *queued_jobs)
    ruling = Ruling()
    if not terms.anew:
        ruling = apply_policy(session, enrolment_id, assignment.id, submission.sha256, grading_request.submitted_at)
    is_put_aside = ruling.over is not None and terms.most_bytes is not None
    if is_put_aside:
        _delete_put_aside(session, is_earlier)
    if terms.most_bytes is not None:
        _check_quota(session, is_earlier, len(packed_request.data), terms.most_bytes)
    job_id = generate_id()
    if not ruling.over:
        # Where the best attempt counts, each is graded.
        replaced = select(SubmissionRow.id).where(*is_earlier, ~match_best_counts())
        jobs.supersede_jobs(session, replaced, job_id, current_time)
    row = SubmissionRow(
        enrolment_id=enrolment_id,
        assignment=assignment.id,
        batch_id=terms.batch_id,
        attempt=previous_attempts + 1,
        sha256=submission.sha256,
        source=grading_request.source,
        size=len(packed_request.data),
        packed=packed_request.data,
        created_at=current_time,
        submitted_at=grading_request.submitted_at,
        days_late=ruling.days_late,
        staff_only=str(ruling.over) if ruling.over else None,
        exceeded=encode(ruling.over),
    )
    session.add(row)
    session.flush()
    job = Job(
        id=job_id,
        submission_id=row.id,
        assignment_version_id=version_id,
        enrolment_id=enrolment_id,
        batch_id=terms.batch_id,
        # No student waits for a staff-only grade.
        lane=JobQueue.BATCH if ruling.over else terms.lane,
        max_attempts=terms.max_attempts,
        forced=terms.anew,
    )
    jobs.enqueue(session, job, current_time)
    if is_put_aside:
        jobs.put_aside_job(session, job_id, current_time)
    source = (
        None
        if terms.anew or is_put_aside
        else result_cache.find_cached_grade(
            session, result_cache.compute_cache_key(session, job_id, hash_grader(), terms.secret_sha256)
        )
    )
    if source is not None:
        jobs.copy_grade(session, job_id, source, current_time)
    return AcceptedSubmission(
        job_id, row.id, submission.student, assignment.id, row.attempt, source, row.staff_only or ""
    )


def _delete_put_aside(session: Session, is_earlier: tuple[ColumnElement[bool], ...]) -> None:
    """Remove earlier submissions over a limit that staff never asked to grade; only the newest is kept.

    Submissions with a comment are kept, too.
    """
    own_submissions = select(SubmissionRow.id).where(*is_earlier, SubmissionRow.staff_only.is_not(None))
    put_aside_jobs = (
        Job.submission_id.in_(own_submissions),
        Job.state == JobState.CANCELLED,
        Job.cancelled_for == CancelReason.OVER_LIMIT,
    )
    # Without the lock, staff could ask for one between the choice and the deletion.
    lock_jobs(session, *put_aside_jobs)
    submission_ids = session.scalars(select(Job.submission_id).where(*put_aside_jobs)).all()
    # A submission that was graded before and requested again has other jobs.
    other_reason = Job.cancelled_for.is_distinct_from(CancelReason.OVER_LIMIT)
    other_jobs = select(Job.submission_id).where(Job.submission_id.in_(submission_ids), other_reason)
    kept_ids = set(session.scalars(other_jobs))
    kept_ids.update(session.scalars(select(Comment.submission_id).where(Comment.submission_id.in_(submission_ids))))
    removed_ids = [each for each in submission_ids if each not in kept_ids]
    session.execute(delete(Job).where(Job.submission_id.in_(removed_ids), *put_aside_jobs))
    session.execute(delete(SubmissionRow).where(SubmissionRow.id.in_(removed_ids)))


def _check_quota(session: Session, is_earlier: tuple[ColumnElement[bool], ...], size: int, max_bytes: int) -> None:
    used_bytes = session.scalar(select(func.coalesce(func.sum(SubmissionRow.size), 0)).where(*is_earlier)) or 0
    if used_bytes + size > max_bytes:
        raise UsageError(
            "your submissions to this assignment would need %(size)s MB, but the limit is %(most)s MB in total; "
            "remove unneeded files, or ask your instructor.",
            size=-(-(used_bytes + size) // MEGABYTE),
            most=max_bytes // MEGABYTE,
        )
