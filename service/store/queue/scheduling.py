"""Whose turn it is: the queued job that is due first by lane, by share of course, batch and student, and by age.

Only reads (and, on PostgreSQL, locks) the row; taking the job is ``jobs.claim``.
"""

from __future__ import annotations

from datetime import datetime, timedelta

from sqlalchemy import ColumnElement, Select, Subquery, and_, case, func, not_, or_, select
from sqlalchemy.orm import Session

from service.store.models import Batch, Enrolment, Job
from service.store.queue.workers import another_lives
from service.store.states import BatchState, JobState, Lane

#: Shares are counted over the jobs begun in this time, so that nobody who was served long ago waits for it.
SHARE_WINDOW = timedelta(seconds=60)
#: Of so many jobs begun, one is a batch's even while people wait.
BATCH_EVERY = 5
#: For so long a job that failed on one worker is left to the others, where there are any.
ELSEWHERE = timedelta(seconds=20)


def claimable(at: datetime) -> tuple[ColumnElement[bool], ...]:
    """What holds of a job that may be claimed at ``at``: it waits, it is due, and its batch is not held back."""
    held_back = select(Batch.id).where(Batch.state != BatchState.OPEN)
    return (
        Job.state == JobState.QUEUED,
        Job.due_at <= at,
        or_(Job.batch_id.is_(None), Job.batch_id.not_in(held_back)),
    )


def recently_begun(at: datetime) -> Select[Lane, int, str | None, int]:
    """The lane, the course, the batch and the student of every job that counts for a share."""
    return (
        select(Job.lane, Enrolment.course_id, Job.batch_id, Job.enrolment_id)
        .join(Enrolment, Job.enrolment_id == Enrolment.id)
        .where(Job.started_at > at - SHARE_WINDOW)
    )


def next_job(session: Session, at: datetime, worker: str) -> str | None:
    """The id of the job that ``worker`` should take next; None when none is due.

    The lane first: people before batches, but for one job in five. In a lane, the course, then the batch, then the
    student of whom fewest jobs were begun in the last minute; then the oldest job.
    """
    # A common table, or SQLite would walk all jobs there ever were to count each share.
    recent = recently_begun(at).cte("recent")
    counted = session.execute(select(recent.c.lane, func.count()).group_by(recent.c.lane))
    by_lane: dict[Lane, int] = dict(counted.all())
    people, batches = by_lane.get(Lane.INTERACTIVE, 0), by_lane.get(Lane.BATCH, 0)
    first = Lane.BATCH if people >= (BATCH_EVERY - 1) * (batches + 1) else Lane.INTERACTIVE

    of_course = shares(recent.c.course_id)
    of_batch = shares(recent.c.batch_id)
    of_student = shares(recent.c.enrolment_id)
    query = (
        select(Job.id)
        .join(Enrolment, Job.enrolment_id == Enrolment.id)
        .outerjoin(of_course, of_course.c.share == Enrolment.course_id)
        .outerjoin(of_batch, of_batch.c.share == Job.batch_id)
        .outerjoin(of_student, of_student.c.share == Job.enrolment_id)
        .where(*claimable(at), not_(_better_elsewhere(worker, at)))
        .order_by(
            case((Job.lane == first, 0), else_=1),
            func.coalesce(of_course.c.begun, 0),
            func.coalesce(of_batch.c.begun, 0),
            func.coalesce(of_student.c.begun, 0),
            Job.queued_at,
            Job.id,
        )
        .limit(1)
        .with_for_update(of=Job, skip_locked=True, key_share=True)
    )
    return session.scalar(query)


def _better_elsewhere(worker: str, at: datetime) -> ColumnElement[bool]:
    """Whether a job failed on this very worker, through a fault of ours, and another worker could try it."""
    # A worker that ended gives back what it held without a fault; then no error is written.
    failed_here = and_(Job.attempt > 0, Job.worker == worker, Job.error.is_not(None))
    return and_(failed_here, Job.due_at > at - ELSEWHERE, another_lives(worker, at))


def shares(share: ColumnElement[str | None] | ColumnElement[int]) -> Subquery:
    """How many of the jobs recently begun each course, each batch, or each student, has."""
    return select(share.label("share"), func.count().label("begun")).group_by(share).subquery()
