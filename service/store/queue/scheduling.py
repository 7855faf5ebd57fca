"""Scheduling: the next job by queue, by fair share of course, batch and student, and by age.

Only reads (and, on PostgreSQL, locks) the row; ``jobs.claim_job`` takes the job.
"""

from __future__ import annotations

from datetime import datetime, timedelta

from sqlalchemy import ColumnElement, Select, Subquery, and_, case, func, not_, or_, select
from sqlalchemy.orm import Session

from service.store.queue.workers import match_other_live_worker
from service.store.states import BatchState, JobQueue, JobState
from service.store.tables.people import Enrolment
from service.store.tables.submissions import Batch, Job

#: Shares count only jobs started within this time, so earlier use is no disadvantage.
SHARE_WINDOW = timedelta(seconds=60)
#: One in this number of started jobs is from a batch, even if interactive jobs wait.
BATCH_JOB_INTERVAL = 5
#: Time for which a job that failed on one worker is reserved for the other workers.
RESERVED_PERIOD = timedelta(seconds=20)


def match_claimable_jobs(current_time: datetime) -> tuple[ColumnElement[bool], ...]:
    """Return the conditions for a claimable job: it is queued and due, and its batch is open."""
    closed_batches = select(Batch.id).where(Batch.state != BatchState.OPEN)
    return (
        Job.state == JobState.QUEUED,
        Job.due_at <= current_time,
        or_(Job.batch_id.is_(None), Job.batch_id.not_in(closed_batches)),
    )


def select_recent_jobs(current_time: datetime) -> Select[JobQueue, int, str | None, int]:
    """Return a query for the queue, course, batch and student of every job that counts towards a share."""
    return (
        select(Job.lane, Enrolment.course_id, Job.batch_id, Job.enrolment_id)
        .join(Enrolment, Job.enrolment_id == Enrolment.id)
        .where(Job.started_at > current_time - SHARE_WINDOW)
    )


def find_next_job(session: Session, current_time: datetime, worker: str) -> str | None:
    """Return the id of the job that ``worker`` should claim next; None if no job is due.

    Interactive jobs come first, except for one job in five. Within a queue, the course with the fewest jobs started in
    the last minute comes first, then the batch, then the student, then the oldest job.
    """
    # A common table expression; without it SQLite would scan all jobs to count each share.
    recent_jobs = select_recent_jobs(current_time).cte("recent")
    queue_rows = session.execute(select(recent_jobs.c.lane, func.count()).group_by(recent_jobs.c.lane))
    job_counts: dict[JobQueue, int] = dict(queue_rows.all())
    interactive_jobs, batch_jobs = job_counts.get(JobQueue.INTERACTIVE, 0), job_counts.get(JobQueue.BATCH, 0)
    first_queue = (
        JobQueue.BATCH if interactive_jobs >= (BATCH_JOB_INTERVAL - 1) * (batch_jobs + 1) else JobQueue.INTERACTIVE
    )

    course_shares = select_shares(recent_jobs.c.course_id)
    batch_shares = select_shares(recent_jobs.c.batch_id)
    student_shares = select_shares(recent_jobs.c.enrolment_id)
    query = (
        select(Job.id)
        .join(Enrolment, Job.enrolment_id == Enrolment.id)
        .outerjoin(course_shares, course_shares.c.share == Enrolment.course_id)
        .outerjoin(batch_shares, batch_shares.c.share == Job.batch_id)
        .outerjoin(student_shares, student_shares.c.share == Job.enrolment_id)
        .where(*match_claimable_jobs(current_time), not_(_match_reserved_jobs(worker, current_time)))
        .order_by(
            case((Job.lane == first_queue, 0), else_=1),
            func.coalesce(course_shares.c.begun, 0),
            func.coalesce(batch_shares.c.begun, 0),
            func.coalesce(student_shares.c.begun, 0),
            Job.queued_at,
            Job.id,
        )
        .limit(1)
        .with_for_update(of=Job, skip_locked=True, key_share=True)
    )
    return session.scalar(query)


def _match_reserved_jobs(worker: str, current_time: datetime) -> ColumnElement[bool]:
    """Return the condition that a job failed with a host fault on this worker and another worker could try it."""
    # A stopped worker returns its jobs without a fault, and then no error is stored.
    has_failed_here = and_(Job.attempt > 0, Job.worker == worker, Job.error.is_not(None))
    return and_(
        has_failed_here, Job.due_at > current_time - RESERVED_PERIOD, match_other_live_worker(worker, current_time)
    )


def select_shares(share: ColumnElement[str | None] | ColumnElement[int]) -> Subquery:
    """Return a subquery that counts the recently started jobs of each course, batch or student."""
    return select(share.label("share"), func.count().label("begun")).group_by(share).subquery()
