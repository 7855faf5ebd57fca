"""Search for lost jobs: expired leases and missing notifications. Concurrent sweeps are safe.

Sends nothing; returns the number of missing notifications.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from datetime import datetime, timedelta

from sqlalchemy import func, or_, select, update
from sqlalchemy.orm import Session

from service.store.engine import Store, now, retry_conflicts
from service.store.locks import match_and_lock_jobs
from service.store.queue import jobs
from service.store.queue.jobs import Claim, RetryPolicy
from service.store.queue.scheduling import match_claimable_jobs
from service.store.states import JobQueue, JobState
from service.store.tables.submissions import Job

#: Databases limit the number of parameters of a statement.
_CHUNK_SIZE = 500


@dataclass(frozen=True, slots=True)
class NoticeCounts:
    """Number of notifications that should be pending, and of those that may be lost."""

    due: int
    stale: int


@retry_conflicts
def requeue_lost_jobs(store: Store, retry: RetryPolicy) -> int:
    """Requeue jobs with expired leases, or mark them dead after the last attempt. Return their number."""
    with store.transaction() as session:
        current_time = now(session)
        jobs.correct_clock(session, current_time, retry.wait)
        is_lost = (Job.state == JobState.RUNNING, Job.lease_until < current_time)
        query = select(Job.id, Job.lease, Job.attempt, Job.max_attempts, Job.worker).where(*is_lost)
        rows = session.execute(query.order_by(Job.id).with_for_update(skip_locked=True, key_share=True)).all()
        for job_id, lease, attempt, max_attempts, worker in rows:
            reason = f"the worker {worker} stopped responding during grading; see its log for details"
            jobs.apply_host_fault(
                session, Claim(job_id, lease or "", attempt, max_attempts, current_time), reason, retry, current_time
            )
        return len(rows)


def count_missing_notices(store: Store, older_seconds: float) -> Mapping[JobQueue, NoticeCounts]:
    """Return the claimable jobs by queue, and those with a notification missing or older than ``older_seconds``."""
    with store.reading() as session:
        current_time = now(session)
        query = select(Job.lane, func.count()).where(*match_claimable_jobs(current_time)).group_by(Job.lane)
        is_stale = or_(Job.notified_at.is_(None), Job.notified_at < current_time - timedelta(seconds=older_seconds))
        due_counts = dict(session.execute(query).all())
        stale_counts = dict(session.execute(query.where(is_stale)).all())
        return {lane: NoticeCounts(count, stale_counts.get(lane, 0)) for lane, count in due_counts.items()}


@retry_conflicts
def mark_notified(store: Store, lane: JobQueue, count: int) -> Sequence[str]:
    """Mark the ``count`` jobs of a queue with the oldest notification as notified now. Return their ids."""
    with store.transaction() as session:
        current_time = now(session)
        oldest_jobs = (
            select(Job.id)
            .where(*match_claimable_jobs(current_time), Job.lane == lane)
            .order_by(func.coalesce(Job.notified_at, Job.queued_at), Job.id)
            .limit(count)
        )
        job_ids = session.scalars(oldest_jobs).all()
        _set_notified(session, job_ids, current_time)
        return job_ids


@retry_conflicts
def mark_not_notified(store: Store, job_ids: Sequence[str]) -> None:
    """Mark these jobs as not notified."""
    with store.transaction() as session:
        _set_notified(session, job_ids, None)


def _set_notified(session: Session, job_ids: Sequence[str], notified_at: datetime | None) -> None:
    job_ids = sorted(job_ids)
    for start in range(0, len(job_ids), _CHUNK_SIZE):
        conditions = (Job.id.in_(job_ids[start : start + _CHUNK_SIZE]), Job.state == JobState.QUEUED)
        options = {"synchronize_session": False}
        statement = update(Job).where(match_and_lock_jobs(*conditions), *conditions).values(notified_at=notified_at)
        session.execute(statement, execution_options=options)
