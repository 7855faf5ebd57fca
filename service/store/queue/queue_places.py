"""Position of a job in the queue and its estimated time, for the person waiting for it. Read-only.

This is an estimate: ``scheduling.py`` decides when a worker claims a job.
"""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass
from datetime import datetime

from sqlalchemy import ColumnElement, Subquery, and_, case, func, or_, select
from sqlalchemy.orm import Session

from service.store.engine import now
from service.store.queue import workers
from service.store.queue.scheduling import SHARE_WINDOW, match_claimable_jobs, select_recent_jobs
from service.store.states import JobQueue, JobState
from service.store.tables.people import Enrolment
from service.store.tables.submissions import Job

#: Estimates use the mean of this number of recent gradings.
_MAX_MEASURED_JOBS = 20
#: Maximum progress shown for a grading that takes longer than usual.
_MAX_PROGRESS = 0.95


@dataclass(frozen=True, slots=True)
class QueuePlace:
    """Number of jobs ahead of a job, and the estimated seconds to its marks; None if unknown.

    ``progress`` (0 to 1) is computed from the usual duration. The share of finished trials would reveal their number to
    students.
    """

    before: int
    seconds: float | None
    workers: int  # active workers
    progress: float = 0.0


def estimate_place(session: Session, job_id: str) -> QueuePlace:
    """Return the place of one queued or running job."""
    return estimate_places(session, [job_id])[job_id]


def estimate_places(session: Session, job_ids: Collection[str]) -> dict[str, QueuePlace]:
    """Return the places of several jobs, with the same number of statements."""
    current_time = now(session)
    jobs = session.scalars(select(Job).where(Job.id.in_(job_ids))).all()
    live_workers = [seen.worker for seen in workers.load_workers(session) if seen.lately]
    slots = sum(worker.concurrency for worker in live_workers)
    jobs_before, job_seconds = _count_jobs_before(session, job_ids, current_time), _measure_usual_seconds(session)
    places = {}
    for job in jobs:
        job_count = jobs_before[job.id] if job.state is JobState.QUEUED else 0
        if job_seconds is None or not live_workers:
            places[job.id] = QueuePlace(job_count, None, len(live_workers))
            continue
        elapsed_seconds = (
            (current_time - job.started_at).total_seconds() if job.state is JobState.RUNNING and job.started_at else 0.0
        )
        progress = min(elapsed_seconds / job_seconds, _MAX_PROGRESS) if job_seconds else 0.0
        places[job.id] = QueuePlace(
            job_count, job_count * job_seconds / slots + job_seconds * (1 - progress), len(live_workers), progress
        )
    return places


def _count_jobs_before(session: Session, job_ids: Collection[str], current_time: datetime) -> dict[str, int]:
    """Return the number of claimable jobs ahead of each of these jobs, by id."""
    recent_jobs = select_recent_jobs(current_time - SHARE_WINDOW, current_time + SHARE_WINDOW).cte("recent")
    batch_shares, student_shares = _select_shares(recent_jobs.c.batch_id), _select_shares(recent_jobs.c.enrolment_id)
    recent_courses = (
        select(Enrolment.course_id).join(recent_jobs, recent_jobs.c.enrolment_id == Enrolment.id).subquery()
    )
    course_shares = _select_shares(recent_courses.c.course_id)
    order = (
        Job.lane == JobQueue.BATCH,
        func.coalesce(course_shares.c.begun, 0),
        func.coalesce(batch_shares.c.begun, 0),
        func.coalesce(student_shares.c.begun, 0),
        Job.queued_at,
        Job.id,
    )
    can_be_claimed, is_selected = and_(*match_claimable_jobs(current_time)), Job.id.in_(job_ids)
    claimable_before = func.sum(case((can_be_claimed, 1), else_=0)).over(order_by=order, rows=(None, -1))
    ranked_jobs = (
        select(Job.id, claimable_before.label("earlier"))
        .join(Enrolment, Job.enrolment_id == Enrolment.id)
        .outerjoin(course_shares, course_shares.c.share == Enrolment.course_id)
        .outerjoin(batch_shares, batch_shares.c.share == Job.batch_id)
        .outerjoin(student_shares, student_shares.c.share == Job.enrolment_id)
        .where(or_(can_be_claimed, is_selected))
        .subquery()
    )
    query = select(ranked_jobs.c.id, func.coalesce(ranked_jobs.c.earlier, 0)).where(ranked_jobs.c.id.in_(job_ids))
    return dict(session.execute(query).all())


def _select_shares(share: ColumnElement[str | None] | ColumnElement[int]) -> Subquery:
    """Return a subquery that counts the recently started jobs of each course, batch or student."""
    return select(share.label("share"), func.count().label("begun")).group_by(share).subquery()


def _measure_usual_seconds(session: Session) -> float | None:
    was_graded = (Job.state == JobState.DONE, Job.copied_from.is_(None), Job.started_at.is_not(None))
    query = (
        select(Job.started_at, Job.finished_at)
        .where(*was_graded)
        .order_by(Job.started_at.desc())
        .limit(_MAX_MEASURED_JOBS)
    )
    durations = [
        (finished - started).total_seconds() for started, finished in session.execute(query) if started and finished
    ]
    return sum(durations) / len(durations) if durations else None
