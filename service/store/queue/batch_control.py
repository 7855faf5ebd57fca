"""Control of a whole batch: pause, resume, cancel, and retry of its dead jobs.

Claims check the batch's state and workers their job's, so nothing here contacts a worker. Web submissions cannot be
paused, because students are waiting for them. ``service.operations.batches`` owns the transactions.
"""

from __future__ import annotations

from dataclasses import dataclass

from sqlalchemy import exists, func, or_, select, update
from sqlalchemy.orm import Session, aliased

from service.store.engine import now
from service.store.locks import match_and_lock_jobs
from service.store.models import Batch, Job, SubmissionRow
from service.store.queue import jobs
from service.store.states import BatchState, JobState
from service.store.web_tables import OpenAssignment
from sim.errors import UsageError


@dataclass(frozen=True, slots=True)
class BatchControlResult:
    """Result of a batch operation: whether the state changed, and the number of jobs waiting and running."""

    changed: bool
    waiting: int
    running: int


@dataclass(frozen=True, slots=True)
class RetryCounts:
    """Numbers of dead jobs that were queued again, and of those left dead because of a newer submission."""

    queued: int
    outdated: int


def pause_batch(session: Session, batch_id: str) -> BatchControlResult:
    """Start no further jobs of the batch; running ones continue. Raises UsageError for a cancelled or a web batch."""
    return _set_state(session, batch_id, BatchState.PAUSED)


def resume_batch(session: Session, batch_id: str) -> BatchControlResult:
    """Resume a paused batch. Raises UsageError for a cancelled batch."""
    return _set_state(session, batch_id, BatchState.OPEN)


def cancel_batch(session: Session, batch_id: str) -> BatchControlResult:
    """Cancel all unfinished jobs of the batch; a running job stops at its next heartbeat.

    A batch without unfinished jobs is not changed. Raises UsageError for a batch of web submissions.
    """
    _lock_batch(session, batch_id)
    _check_not_web_batch(session, batch_id)
    waiting, running = _count_unfinished(session, batch_id)
    if waiting + running == 0:
        return BatchControlResult(False, 0, 0)
    jobs.cancel_jobs(session, batch_id, "the batch was cancelled", now(session))
    session.execute(update(Batch).where(Batch.id == batch_id).values(state=BatchState.CANCELLED))
    return BatchControlResult(True, waiting, running)


def retry_dead_jobs(session: Session, batch_id: str | None) -> RetryCounts:
    """Queue the dead jobs of a batch again, with all their attempts. None means all dead jobs.

    Raises UsageError for a cancelled batch; with None, jobs of cancelled batches are skipped.
    """
    if batch_id is None:
        cancelled = select(Batch.id).where(Batch.state == BatchState.CANCELLED)
        of_batch = or_(Job.batch_id.is_(None), Job.batch_id.not_in(cancelled))
    else:
        _check_not_cancelled(_lock_batch(session, batch_id), batch_id)
        of_batch = Job.batch_id == batch_id
    newer = aliased(SubmissionRow)
    outdated = exists().where(
        newer.enrolment_id == SubmissionRow.enrolment_id,
        newer.assignment == SubmissionRow.assignment,
        newer.attempt > SubmissionRow.attempt,
        newer.staff_only.is_(None),
    )
    of_newest = select(SubmissionRow.id).where(~outdated)
    queued = jobs.retry_jobs(session, (of_batch, Job.submission_id.in_(of_newest)), now(session))
    left = session.scalar(select(func.count()).select_from(Job).where(of_batch, Job.state == JobState.DEAD)) or 0
    return RetryCounts(queued, left)


def _set_state(session: Session, batch_id: str, state: BatchState) -> BatchControlResult:
    before = _lock_batch(session, batch_id)
    _check_not_cancelled(before, batch_id)
    _check_not_web_batch(session, batch_id)
    session.execute(update(Batch).where(Batch.id == batch_id).values(state=state))
    # So that workers are notified immediately of resumed jobs.
    waiting = (Job.batch_id == batch_id, Job.state == JobState.QUEUED)
    unannounced = update(Job).where(match_and_lock_jobs(*waiting), *waiting).values(notified_at=None)
    session.execute(unannounced, execution_options={"synchronize_session": False})
    return BatchControlResult(before is not state, *_count_unfinished(session, batch_id))


def _lock_batch(session: Session, batch_id: str) -> BatchState:
    """Return the batch's state and lock the batch until the end of the transaction."""
    state = session.scalar(select(Batch.state).where(Batch.id == batch_id).with_for_update(key_share=True))
    if state is None:
        raise UsageError(f"there is no batch {batch_id}")
    return state


def _check_not_cancelled(state: BatchState, batch_id: str) -> None:
    if state is BatchState.CANCELLED:
        raise UsageError(f"batch {batch_id} was cancelled; submit it again to have the rest of it graded")


def _check_not_web_batch(session: Session, batch_id: str) -> None:
    assignment = session.scalar(select(OpenAssignment.assignment).where(OpenAssignment.batch_id == batch_id))
    if assignment is not None:
        raise UsageError(
            f"batch {batch_id} contains web submissions and cannot be paused or cancelled; "
            f"to stop submissions, close {assignment}"
        )


def _count_unfinished(session: Session, batch_id: str) -> tuple[int, int]:
    counted = select(Job.state, func.count()).where(Job.batch_id == batch_id).group_by(Job.state)
    states = dict(session.execute(counted).all())
    return states.get(JobState.QUEUED, 0), states.get(JobState.RUNNING, 0)
