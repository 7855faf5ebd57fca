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
from service.store.queue import jobs
from service.store.states import BatchState, JobState
from service.store.tables.courses import OpenAssignment
from service.store.tables.submissions import Batch, Job, SubmissionRow
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
    queued_count, running_count = _count_unfinished(session, batch_id)
    if queued_count + running_count == 0:
        return BatchControlResult(False, 0, 0)
    jobs.cancel_jobs(session, batch_id, "the batch was cancelled", now(session))
    session.execute(update(Batch).where(Batch.id == batch_id).values(state=BatchState.CANCELLED))
    return BatchControlResult(True, queued_count, running_count)


def retry_dead_jobs(session: Session, batch_id: str | None) -> RetryCounts:
    """Queue the dead jobs of a batch again, with all their attempts. None means all dead jobs.

    Raises UsageError for a cancelled batch; with None, jobs of cancelled batches are skipped.
    """
    if batch_id is None:
        cancelled_batches = select(Batch.id).where(Batch.state == BatchState.CANCELLED)
        is_selected = or_(Job.batch_id.is_(None), Job.batch_id.not_in(cancelled_batches))
    else:
        _check_not_cancelled(_lock_batch(session, batch_id), batch_id)
        is_selected = Job.batch_id == batch_id
    newer_submission = aliased(SubmissionRow)
    has_newer_attempt = exists().where(
        newer_submission.enrolment_id == SubmissionRow.enrolment_id,
        newer_submission.assignment == SubmissionRow.assignment,
        newer_submission.attempt > SubmissionRow.attempt,
        newer_submission.staff_only.is_(None),
    )
    newest_submissions = select(SubmissionRow.id).where(~has_newer_attempt)
    queued_count = jobs.retry_jobs(session, (is_selected, Job.submission_id.in_(newest_submissions)), now(session))
    remaining_count = (
        session.scalar(select(func.count()).select_from(Job).where(is_selected, Job.state == JobState.DEAD)) or 0
    )
    return RetryCounts(queued_count, remaining_count)


def _set_state(session: Session, batch_id: str, state: BatchState) -> BatchControlResult:
    previous_state = _lock_batch(session, batch_id)
    _check_not_cancelled(previous_state, batch_id)
    _check_not_web_batch(session, batch_id)
    session.execute(update(Batch).where(Batch.id == batch_id).values(state=state))
    # So that workers are notified immediately of resumed jobs.
    is_queued = (Job.batch_id == batch_id, Job.state == JobState.QUEUED)
    statement = update(Job).where(match_and_lock_jobs(*is_queued), *is_queued).values(notified_at=None)
    session.execute(statement, execution_options={"synchronize_session": False})
    return BatchControlResult(previous_state is not state, *_count_unfinished(session, batch_id))


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
    count_query = select(Job.state, func.count()).where(Job.batch_id == batch_id).group_by(Job.state)
    states = dict(session.execute(count_query).all())
    return states.get(JobState.QUEUED, 0), states.get(JobState.RUNNING, 0)
