"""Completion of pools: further gradings that run all trials of a pool after the first ones gave provisional marks.

A completion is a job in the lowest queue, until somebody waits for it. Its grade replaces the provisional one.
"""

from __future__ import annotations

from datetime import datetime

from sqlalchemy import select
from sqlalchemy.orm import Session

from service.store import audit, webhook_events
from service.store.grades import statements
from service.store.states import CompletionRule, JobQueue, Standing
from service.store.tables.courses import Course
from service.store.tables.people import Enrolment
from service.store.tables.submissions import Job


def build_completion(job: Job) -> Job:
    """Return the job that completes the pools of a provisional grade."""
    return Job(
        submission_id=job.submission_id,
        assignment_version_id=job.assignment_version_id,
        enrolment_id=job.enrolment_id,
        batch_id=None,
        lane=JobQueue.COMPLETION,
        max_attempts=job.max_attempts,
        regrade_of=job.id,
        standing=Standing.PROPOSED,
        whole_pools=True,
    )


def is_completion(session: Session, job_id: str) -> bool:
    """Return whether the job runs all trials of its pools."""
    return bool(session.scalar(select(Job.whole_pools).where(Job.id == job_id)))


def replace_provisional_grade(session: Session, completion: Job, current_time: datetime) -> None:
    """Put the grade of a finished completion in the place of the provisional one.

    The provisional grade may have been published on purpose. Then the exact one is published too. If it is lower, the
    student keeps the marks that were published, unless the course says otherwise. A grade that was replaced meanwhile
    is not replaced again.
    """
    provisional = session.get_one(Job, completion.regrade_of, with_for_update={"key_share": True})
    is_lower = (completion.marks or 0) < (provisional.marks or 0)
    keeps_marks = provisional.published_at is not None and is_lower and not is_always_replaced(session, provisional)
    if provisional.standing is Standing.KEPT or keeps_marks:
        completion.standing = Standing.KEPT
        return
    new_standing, provisional.standing = provisional.standing, Standing.KEPT
    # The database rejects a second standing job of a submission, even within a transaction.
    session.flush()
    completion.standing = new_standing
    if provisional.published_at is not None:
        _publish(session, provisional, completion, current_time)


def _publish(session: Session, provisional: Job, completion: Job, current_time: datetime) -> None:
    """Release the exact grade to the student who could see the provisional one, and report it as a publication."""
    completion.published_at, completion.published_by = current_time, provisional.published_by
    statements.state_publication(session, [completion.id])
    worker = completion.worker or "workers"
    audit.record_action(session, worker, "publish exact", "job", completion.id, replaced=provisional.id)
    webhook_events.emit_grades_published(
        session, _load_course(session, completion).id, grade=completion.id, published=1
    )


def is_always_replaced(session: Session, provisional: Job) -> bool:
    """Return whether the course replaces this grade, once it was published, also with lower exact marks."""
    return _load_course(session, provisional).completion_rule is CompletionRule.EXACT


def _load_course(session: Session, job: Job) -> Course:
    query = select(Course).join(Enrolment, Enrolment.course_id == Course.id)
    return session.scalars(query.where(Enrolment.id == job.enrolment_id)).one()
