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
from service.store.models import Job
from service.store.queue import jobs
from service.store.queue.jobs import Claim, RetryPolicy
from service.store.queue.scheduling import match_claimable_jobs
from service.store.states import JobQueue, JobState

#: Databases limit the number of parameters of a statement.
_AT_ONCE = 500


@dataclass(frozen=True, slots=True)
class NoticeCounts:
    """Number of notifications that should be pending, and of those that may be lost."""

    due: int
    stale: int


@retry_conflicts
def requeue_lost_jobs(store: Store, retry: RetryPolicy) -> int:
    """Requeue jobs with expired leases, or mark them dead after the last attempt. Return their number."""
    with store.transaction() as session:
        at = now(session)
        jobs.correct_clock(session, at, retry.wait)
        lost = (Job.state == JobState.RUNNING, Job.lease_until < at)
        query = select(Job.id, Job.lease, Job.attempt, Job.max_attempts, Job.worker).where(*lost)
        rows = session.execute(query.order_by(Job.id).with_for_update(skip_locked=True, key_share=True)).all()
        for job_id, lease, attempt, max_attempts, worker in rows:
            reason = f"the worker {worker} stopped responding during grading; see its log for details"
            jobs.apply_host_fault(session, Claim(job_id, lease or "", attempt, max_attempts, at), reason, retry, at)
        return len(rows)


def count_missing_notices(store: Store, older_seconds: float) -> Mapping[JobQueue, NoticeCounts]:
    """Return the claimable jobs by queue, and those with a notification missing or older than ``older_seconds``."""
    with store.reading() as session:
        at = now(session)
        query = select(Job.lane, func.count()).where(*match_claimable_jobs(at)).group_by(Job.lane)
        stale = or_(Job.notified_at.is_(None), Job.notified_at < at - timedelta(seconds=older_seconds))
        all_due = dict(session.execute(query).all())
        all_stale = dict(session.execute(query.where(stale)).all())
        return {lane: NoticeCounts(count, all_stale.get(lane, 0)) for lane, count in all_due.items()}


@retry_conflicts
def mark_notified(store: Store, lane: JobQueue, count: int) -> Sequence[str]:
    """Mark the ``count`` jobs of a queue with the oldest notification as notified now. Return their ids."""
    with store.transaction() as session:
        at = now(session)
        oldest = (
            select(Job.id)
            .where(*match_claimable_jobs(at), Job.lane == lane)
            .order_by(func.coalesce(Job.notified_at, Job.queued_at), Job.id)
            .limit(count)
        )
        ids = session.scalars(oldest).all()
        _set_notified(session, ids, at)
        return ids


@retry_conflicts
def mark_not_notified(store: Store, ids: Sequence[str]) -> None:
    """Mark these jobs as not notified."""
    with store.transaction() as session:
        _set_notified(session, ids, None)


def _set_notified(session: Session, ids: Sequence[str], at: datetime | None) -> None:
    ids = sorted(ids)
    for start in range(0, len(ids), _AT_ONCE):
        some = (Job.id.in_(ids[start : start + _AT_ONCE]), Job.state == JobState.QUEUED)
        options = {"synchronize_session": False}
        statement = update(Job).where(match_and_lock_jobs(*some), *some).values(notified_at=at)
        session.execute(statement, execution_options=options)
