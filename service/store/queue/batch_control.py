"""What may be done to a whole batch: paused, resumed, cancelled, its dead jobs retried.

A claim looks at the batch's state, and a worker at its job's, so nothing here talks to a worker. Submissions on the web
are not paused, because students wait for them. ``service.operations.batches`` owns the transactions.
"""

from __future__ import annotations

from dataclasses import dataclass

from sqlalchemy import exists, func, or_, select, update
from sqlalchemy.orm import Session, aliased

from service.store.engine import now
from service.store.locks import locked_jobs
from service.store.models import Batch, Job, SubmissionRow
from service.store.queue import jobs
from service.store.states import BatchState, JobState
from service.store.web_tables import OpenAssignment
from sim.errors import UsageError


@dataclass(frozen=True, slots=True)
class Controlled:
    """Whether the batch's state changed, and how many of its jobs waited and ran then."""

    changed: bool
    waiting: int
    running: int


@dataclass(frozen=True, slots=True)
class Retried:
    """How many dead jobs wait again, and how many stay dead because their student submitted anew."""

    queued: int
    outdated: int


def pause(session: Session, batch_id: str) -> Controlled:
    """Begin no more of the batch; what runs goes on. Raises UsageError for one cancelled, or of the web."""
    return _set(session, batch_id, BatchState.PAUSED)


def resume(session: Session, batch_id: str) -> Controlled:
    """Let a paused batch go on. Raises UsageError for a batch that was cancelled."""
    return _set(session, batch_id, BatchState.OPEN)


def cancel(session: Session, batch_id: str) -> Controlled:
    """End all jobs of the batch that have not ended; a worker that runs one is told at its next heartbeat.

    A batch with nothing left to end stays as it is. Raises UsageError for what is submitted on the web.
    """
    _state(session, batch_id)
    _refuse_of_the_web(session, batch_id)
    waiting, running = _unfinished(session, batch_id)
    if waiting + running == 0:
        return Controlled(False, 0, 0)
    jobs.cancel(session, batch_id, "the batch was cancelled", now(session))
    session.execute(update(Batch).where(Batch.id == batch_id).values(state=BatchState.CANCELLED))
    return Controlled(True, waiting, running)


def retry(session: Session, batch_id: str | None) -> Retried:
    """Queue the dead jobs of a batch again, with all their attempts; None for every dead job there is.

    Raises UsageError for a batch that was cancelled; with None their jobs are passed over.
    """
    if batch_id is None:
        cancelled = select(Batch.id).where(Batch.state == BatchState.CANCELLED)
        of_batch = or_(Job.batch_id.is_(None), Job.batch_id.not_in(cancelled))
    else:
        _refuse_cancelled(_state(session, batch_id), batch_id)
        of_batch = Job.batch_id == batch_id
    newer = aliased(SubmissionRow)
    outdated = exists().where(
        newer.enrolment_id == SubmissionRow.enrolment_id,
        newer.assignment == SubmissionRow.assignment,
        newer.attempt > SubmissionRow.attempt,
        newer.staff_only.is_(None),
    )
    of_newest = select(SubmissionRow.id).where(~outdated)
    queued = jobs.retry(session, (of_batch, Job.submission_id.in_(of_newest)), now(session))
    left = session.scalar(select(func.count()).select_from(Job).where(of_batch, Job.state == JobState.DEAD)) or 0
    return Retried(queued, left)


def _set(session: Session, batch_id: str, state: BatchState) -> Controlled:
    before = _state(session, batch_id)
    _refuse_cancelled(before, batch_id)
    _refuse_of_the_web(session, batch_id)
    session.execute(update(Batch).where(Batch.id == batch_id).values(state=state))
    # So that what goes on is notified for at once.
    waiting = (Job.batch_id == batch_id, Job.state == JobState.QUEUED)
    unannounced = update(Job).where(locked_jobs(*waiting), *waiting).values(notified_at=None)
    session.execute(unannounced, execution_options={"synchronize_session": False})
    return Controlled(before is not state, *_unfinished(session, batch_id))


def _state(session: Session, batch_id: str) -> BatchState:
    """The batch's state, locked to the end of the transaction."""
    state = session.scalar(select(Batch.state).where(Batch.id == batch_id).with_for_update(key_share=True))
    if state is None:
        raise UsageError(f"there is no batch {batch_id}")
    return state


def _refuse_cancelled(state: BatchState, batch_id: str) -> None:
    if state is BatchState.CANCELLED:
        raise UsageError(f"batch {batch_id} was cancelled; submit it again to have the rest of it graded")


def _refuse_of_the_web(session: Session, batch_id: str) -> None:
    assignment = session.scalar(select(OpenAssignment.assignment).where(OpenAssignment.batch_id == batch_id))
    if assignment is not None:
        raise UsageError(
            f"batch {batch_id} is what students submit on the web, which is not held back; "
            f"close {assignment}, and nobody submits to it any more"
        )


def _unfinished(session: Session, batch_id: str) -> tuple[int, int]:
    counted = select(Job.state, func.count()).where(Job.batch_id == batch_id).group_by(Job.state)
    states = dict(session.execute(counted).all())
    return states.get(JobState.QUEUED, 0), states.get(JobState.RUNNING, 0)
