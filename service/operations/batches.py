"""Batches: find, submit, pause, resume, cancel and retry them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import TYPE_CHECKING

from sqlalchemy import select
from sqlalchemy.orm import Session

from service.operations.context import Actor, Service
from service.operations.lookup import (
    check_operator,
    load_names_for_actor,
    require_any_batch,
    require_batch,
    require_course,
    require_named_course,
)
from service.store import audit
from service.store.batches import batches, intake, preflight
from service.store.batches.intake import AcceptedBatch, BatchIntake
from service.store.batches.intake import AcceptedSubmission as AcceptedSubmission
from service.store.batches.known_submissions import KnownSubmission as KnownSubmission
from service.store.batches.preflight import IntakePreview
from service.store.courses import open_assignments
from service.store.courses.hidden_names import HiddenNames
from service.store.engine import now, retry_conflicts
from service.store.installation import load_secret
from service.store.people import membership
from service.store.people.students import DEFAULT_COURSE, ensure_course
from service.store.queue import batch_control
from service.store.queue.batch_control import BatchControlResult as BatchControlResult
from service.store.queue.batch_control import RetryCounts as RetryCounts
from service.store.states import JobQueue, Role
from service.store.tables.courses import Course
from service.store.tables.people import Enrolment
from service.store.tables.submissions import Job
from sim.errors import UsageError
from submissions.student_identity import RejectedSubmission

if TYPE_CHECKING:
    from submissions.assignment.definition import Assignment
    from submissions.batch_folder import BatchContents
    from submissions.grading_request import GradingRequest


@dataclass(frozen=True, slots=True)
class CourseItem:
    """The id of a batch or grade, and the id of its course."""

    course_id: int
    id: str


def find(service: Service, actor: Actor, start: str) -> CourseItem:
    """Return the batch of any course whose id begins with ``start``, for operators.

    Raises:
        UsageError: The prefix matches no batch or several.
    """
    check_operator(actor)
    with service.store.reading() as session:
        row = require_any_batch(session, batches.find_batch(session, start))
        return CourseItem(row.course_id, row.id)


def find_grade(service: Service, actor: Actor, start: str) -> CourseItem:
    """Return the grade of any course whose id begins with ``start``, for operators.

    Raises:
        UsageError: The prefix matches no grade or several.
    """
    check_operator(actor)
    with service.store.reading() as session:
        row = session.get_one(Job, batches.find_job(session, start))
        return CourseItem(session.get_one(Enrolment, row.enrolment_id).course_id, row.id)


@dataclass(frozen=True, slots=True)
class SubmissionPreview:
    """Preview of a submission, with its student's name if known."""

    request: GradingRequest
    name: str
    intake_preview: IntakePreview


@dataclass(frozen=True, slots=True)
class SubmitRequest:
    """Submissions of several students. ``again`` also grades those that were submitted before."""

    name: str
    contents: BatchContents
    again: bool = False


@dataclass(frozen=True, slots=True)
class SubmittedBatch:
    """The new batch (None if nothing was new), submissions known before, and all rejections."""

    batch: AcceptedBatch | None
    known: tuple[KnownSubmission, ...]
    refusals: tuple[RejectedSubmission, ...]
    rejected_by_course: tuple[RejectedSubmission, ...]  # those rejected by the course rather than while reading

    @property
    def jobs(self) -> tuple[AcceptedSubmission, ...]:
        """Return the submissions of the new batch."""
        return () if self.batch is None else self.batch.jobs

    @property
    def queued(self) -> int:
        """Return the number of submissions to grade."""
        return sum(job.copied_from is None for job in self.jobs)

    @property
    def copied(self) -> int:
        """Return the number of submissions that got the grade of an identical one immediately."""
        return sum(job.copied_from is not None for job in self.jobs)


def submit(service: Service, actor: Actor, course_id: int, request: SubmitRequest) -> SubmittedBatch:
    """Create a batch of submissions and notify the workers. Students appear under the names that the actor may see.

    Raises:
        NotFound: The actor does not instruct the course.
        UsageError: None of the submissions can be accepted.
    """
    with service.store.reading() as session:
        course = require_course(session, actor, course_id, Role.INSTRUCTOR).name
    contents = request.contents
    if not contents.grading_requests:
        raise _build_rejection_error(contents.refusals)
    record = partial(_record_submission, actor.name, len(contents.refusals))
    batch = (request.name, contents.grading_requests, contents.refusals)
    max_attempts = service.settings.max_attempts
    if request.again:
        accepted_batch = intake.accept_batch(
            service.store, *batch, course=course, max_attempts=max_attempts, record=record
        )
        batch_intake = BatchIntake(accepted_batch, (), accepted_batch.refused)
    else:
        batch_intake = intake.accept_new_submissions(
            service.store, *batch, course=course, max_attempts=max_attempts, record=record
        )
    refusals = (*contents.refusals, *batch_intake.refused)
    if batch_intake.batch is None and not batch_intake.known:
        raise _build_rejection_error(refusals)
    submitted_batch = _hide_names(batch_intake, refusals, load_names_for_actor(service, actor, course_id))
    service.notifier.grade(JobQueue.BATCH, submitted_batch.queued)
    return submitted_batch


def resolve_course(service: Service, actor: Actor, name: str | None) -> int:
    """Return the id of a course by name, for operators; without a name, the default course, created if necessary.

    Raises:
        NotFound: No course has this name.
    """
    check_operator(actor)
    with service.store.reading() as session:
        named_course_id = session.scalars(
            select(Course.id).where(Course.name == (name or DEFAULT_COURSE))
        ).one_or_none()
        if name is not None and named_course_id is None:
            return require_named_course(session, actor, name).id
    if named_course_id is not None:
        return named_course_id
    with service.store.transaction() as session:
        return ensure_course(session, DEFAULT_COURSE, now(session))


def find_batch_assignment(service: Service, actor: Actor, course_id: int, name: str) -> Assignment | None:
    """Return the assignment of a batch from the course or the catalogue; None for an empty name.

    Raises:
        NotFound: The actor does not instruct the course.
        UsageError: Neither the course nor the catalogue has it.
    """
    with service.store.reading() as session:
        require_course(session, actor, course_id, Role.INSTRUCTOR)
        return load_course_assignment(session, course_id, name) if name else None


def preview_submissions(
    service: Service, actor: Actor, course_id: int, contents: BatchContents
) -> list[SubmissionPreview]:
    """Return a preview of each submission of an upload. Raises NotFound."""
    secret, hidden_names = load_secret(service.store).sha256, load_names_for_actor(service, actor, course_id)
    with service.store.reading() as session:
        require_course(session, actor, course_id, Role.INSTRUCTOR)
        intake_previews = preflight.preview_intake(
            session, course_id, contents.grading_requests, secret, hidden_names.assignments
        )
        names = {each.id: each.name for each in membership.list_members(session, course_id)}
    return [
        SubmissionPreview(asked, _find_student_name(asked, names), ahead)
        for asked, ahead in zip(contents.grading_requests, intake_previews, strict=True)
    ]


def load_course_assignment(session: Session, course_id: int, name: str) -> Assignment:
    """Return an assignment from the course, otherwise from the catalogue; never from a folder.

    Raises UsageError if neither has it.
    """
    if name in {each.assignment for each in open_assignments.list_assignments(session, course_id)}:
        return open_assignments.load_assignment(session, course_id, name)
    from submissions.assignment.reader import find_in_catalogue

    return find_in_catalogue(name)


@retry_conflicts
def pause(service: Service, actor: Actor, course_id: int, batch_id: str) -> BatchControlResult:
    """Start no further jobs of a batch; running jobs continue.

    Raises:
        NotFound: The course does not have the batch, or the actor does not instruct it.
        UsageError: The batch was cancelled, or consists of web submissions.
    """
    with service.store.transaction() as session:
        require_course(session, actor, course_id, Role.INSTRUCTOR)
        require_batch(session, course_id, batch_id)
        result = batch_control.pause_batch(session, batch_id)
        if result.changed:
            audit.record_action(session, actor.name, "pause", "batch", batch_id)
        return result


def resume(service: Service, actor: Actor, course_id: int, batch_id: str) -> BatchControlResult:
    """Resume a paused batch and notify the workers.

    Raises:
        NotFound: The course does not have the batch, or the actor does not instruct it.
        UsageError: The batch was cancelled, or consists of web submissions.
    """
    result = _resume(service, actor, course_id, batch_id)
    service.notifier.grade(JobQueue.BATCH, result.waiting)
    return result


@retry_conflicts
def cancel(service: Service, actor: Actor, course_id: int, batch_id: str) -> BatchControlResult:
    """Cancel all unfinished jobs of a batch; existing marks are kept.

    Raises:
        NotFound: The course does not have the batch, or the actor does not instruct it.
        UsageError: The batch consists of web submissions.
    """
    with service.store.transaction() as session:
        require_course(session, actor, course_id, Role.INSTRUCTOR)
        require_batch(session, course_id, batch_id)
        result = batch_control.cancel_batch(session, batch_id)
        if result.changed:
            audit.record_action(
                session, actor.name, "cancel", "batch", batch_id, not_begun=result.waiting, stopped=result.running
            )
        return result


def retry(service: Service, actor: Actor, course_id: int, batch_id: str) -> RetryCounts:
    """Queue the dead jobs of a batch again and notify the workers.

    Raises:
        NotFound: The course does not have the batch, or the actor does not instruct it.
        UsageError: The batch was cancelled.
    """
    return _notify_workers(service, _retry(service, actor, course_id, batch_id))


def retry_dead(service: Service, actor: Actor, batch_id: str | None) -> RetryCounts:
    """Queue the dead jobs of a batch of any course again, or all dead jobs for None; for operators.

    Raises:
        NotFound: The batch does not exist, or the actor is not an operator.
        UsageError: The batch was cancelled.
    """
    return _notify_workers(service, _retry(service, actor, None, batch_id))


def _build_rejection_error(refusals: Sequence[RejectedSubmission]) -> UsageError:
    first_sentence = refusals[0].sentence if refusals else "there are none"
    return UsageError(f"none of {len(refusals)} submissions can be accepted; {first_sentence}")


def _record_submission(actor: str, refusal_count: int, session: Session, batch_intake: BatchIntake) -> None:
    if batch_intake.batch is not None:
        counts = {"submissions": len(batch_intake.batch.jobs), "refused": refusal_count + len(batch_intake.refused)}
        audit.record_action(
            session, actor, "submit", "batch", batch_intake.batch.id, **counts, known=len(batch_intake.known)
        )


def _hide_names(
    batch_intake: BatchIntake, refusals: tuple[RejectedSubmission, ...], hidden_names: HiddenNames
) -> SubmittedBatch:
    batch = batch_intake.batch
    if batch is not None:
        jobs = (replace(job, student=hidden_names.label_student(job.assignment, job.student)) for job in batch.jobs)
        batch = replace(batch, jobs=tuple(jobs))
    known_jobs = (
        replace(each, student=hidden_names.label_student(each.assignment, each.student)) for each in batch_intake.known
    )
    return SubmittedBatch(batch, tuple(known_jobs), refusals, batch_intake.refused)


def _find_student_name(grading_request: GradingRequest, names: Mapping[str, str]) -> str:
    """Return the student's name if it differs from the id: from the batch, otherwise from the course."""
    name = grading_request.student.name if grading_request.student.name != grading_request.student.id else ""
    return name or names.get(grading_request.submission.student, "")


@retry_conflicts
def _resume(service: Service, actor: Actor, course_id: int, batch_id: str) -> BatchControlResult:
    with service.store.transaction() as session:
        require_course(session, actor, course_id, Role.INSTRUCTOR)
        require_batch(session, course_id, batch_id)
        result = batch_control.resume_batch(session, batch_id)
        if result.changed:
            audit.record_action(session, actor.name, "resume", "batch", batch_id)
        return result


@retry_conflicts
def _retry(service: Service, actor: Actor, course_id: int | None, batch_id: str | None) -> RetryCounts:
    """Retry dead jobs. Without a course, the actor must be an operator."""
    with service.store.transaction() as session:
        if course_id is None:
            check_operator(actor)
            if batch_id is not None:
                require_any_batch(session, batch_id)
        else:
            require_course(session, actor, course_id, Role.INSTRUCTOR)
            require_batch(session, course_id, batch_id or "")
        retry_counts = batch_control.retry_dead_jobs(session, batch_id)
        if retry_counts.queued:
            audit.record_action(session, actor.name, "retry", "batch", batch_id or "all", queued=retry_counts.queued)
        return retry_counts


def _notify_workers(service: Service, retry_counts: RetryCounts) -> RetryCounts:
    # Each job returns to its own queue; extra notifications are harmless.
    for lane in JobQueue:
        service.notifier.grade(lane, retry_counts.queued)
    return retry_counts
