"""Operations on jobs. Only they apply the transitions of ``job_transitions.py``.

No other module writes a job's state, lease or due time.

A worker owns a job through the token of its lease; a change with an outdated token is rejected. ``scheduling.py``
chooses the next job, ``lease_reaper.py`` finds lost ones, and ``plots.py`` handles plots.
"""

from __future__ import annotations

import os
import secrets
from collections.abc import Callable
from dataclasses import dataclass
from datetime import datetime, timedelta
from functools import cache
from typing import TYPE_CHECKING, Any, cast

from sqlalchemy import ColumnElement, Select, Table, bindparam, select, update
from sqlalchemy.orm import Session
from sqlalchemy.sql.dml import ReturningUpdate

from service.store import phases, webhook_events
from service.store.codec import encode
from service.store.engine import Store, now, retry_conflicts
from service.store.grades import overrides, plots, result_cache
from service.store.grades.grade_sentences import encode_sentences
from service.store.installation import load_secret
from service.store.locks import match_and_lock_jobs
from service.store.queue import pool_completions, workers
from service.store.queue.job_transitions import (
    ASK_FOR,
    CANCEL,
    CLAIM,
    COPY,
    ENQUEUE,
    FINISH,
    GIVE_BACK,
    GIVE_UP,
    HEARTBEAT,
    PUT_ASIDE,
    RETRY,
    SUPERSEDE,
    TRY_AGAIN,
    Transition,
    apply_transition,
)
from service.store.queue.scheduling import find_choices
from service.store.states import CancelReason, JobState, PlotState
from service.store.tables.submissions import Job
from service.version import hash_grader
from sim.errors import Cancelled, HostError

if TYPE_CHECKING:
    from service.store.grades import results

_MAX_BACKOFF = timedelta(hours=1)
#: Smaller clock corrections are normal and ignored.
_TOLERANCE = timedelta(seconds=2)


class LeaseLost(Cancelled):
    """The worker no longer owns the job: it was cancelled or claimed by another worker."""


@dataclass(frozen=True, slots=True)
class Claim:
    """A job owned by one worker."""

    job_id: str
    lease: str
    attempt: int  # 1 is the first
    max_attempts: int
    at: datetime  # the database's clock when it was claimed


@dataclass(frozen=True, slots=True)
class RetryPolicy:
    """Retry policy after host faults. The delay starts at ``backoff_seconds`` and doubles."""

    backoff_seconds: float

    def wait(self, attempt: int) -> timedelta:
        """Return the delay after attempt number ``attempt`` (1 is the first)."""
        return min(timedelta(seconds=self.backoff_seconds * 2.0 ** min(attempt - 1, 20)), _MAX_BACKOFF)


def enqueue(session: Session, job: Job, current_time: datetime) -> str:
    """Queue a new job and return its id."""
    job.state = ENQUEUE.after
    job.queued_at = job.due_at = current_time
    session.add(job)
    session.flush()
    return job.id


def copy_grade(session: Session, job_id: str, source_id: str, current_time: datetime) -> None:
    """Give a queued job the grade of an identical one. Raises HostError if it is not queued."""
    values = result_cache.build_copied_values(session, source_id, job_id, current_time)
    if not apply_transition(session, COPY, (Job.id == job_id,), current_time, values):
        raise HostError(f"The job {job_id} cannot be given a grade: it does not wait")
    result_cache.copy_rows(session, source_id, job_id)
    _settle_grade(session, job_id, current_time)
    webhook_events.emit_grade_copied(session, job_id)


def supersede_jobs(session: Session, submissions: Select[int], new_job_id: str, current_time: datetime) -> None:
    """Cancel queued jobs of these submissions in favour of the job ``new_job_id``; regrades are not cancelled."""
    conditions = (Job.regrade_of.is_(None), Job.submission_id.in_(submissions))
    reason = {
        "error": f"superseded by {new_job_id}",
        "cancelled_for": CancelReason.SUPERSEDED,
        "superseded_by": new_job_id,
    }
    if apply_transition(session, SUPERSEDE, conditions, current_time, reason):
        webhook_events.emit_superseded_batches(session, submissions, current_time)


def put_aside_job(session: Session, job_id: str, current_time: datetime) -> None:
    """Cancel a queued job that is over a limit; it is graded only if staff ask for it."""
    sentence = "over a limit: it is graded when staff ask for it"
    apply_transition(
        session,
        PUT_ASIDE,
        (Job.id == job_id,),
        current_time,
        {"error": sentence, "cancelled_for": CancelReason.OVER_LIMIT},
    )


def queue_over_limit_job(session: Session, job_id: str, current_time: datetime) -> bool:
    """Queue a job that was over a limit. Return whether it was."""
    conditions = (Job.id == job_id, Job.cancelled_for == CancelReason.OVER_LIMIT)
    return apply_transition(session, ASK_FOR, conditions, current_time, {"error": None, "cancelled_for": None}) > 0


@retry_conflicts
def claim_job(store: Store, worker: str, lease_seconds: float) -> Claim | None:
    """Claim the next job; None if no job is due or the worker may not claim."""
    with store.short_transactions() as connection:
        turn = find_choices(connection, worker)
        if turn is None:
            return None
        current_time, choices = turn
        lease = secrets.token_hex(16)
        values = {
            "lease": lease,
            "lease_until": current_time + timedelta(seconds=lease_seconds),
            "process": os.getpid(),
        }
        for choice in choices:
            statement = _build_claim_statement(choice.query)
            row = connection.execute(statement, {**choice.parameters, **values}).one_or_none()
            if row is not None:
                return Claim(row.id, lease, row.attempt, row.max_attempts, current_time)
        return None


@cache
def _build_claim_statement(choice: Select[Any]) -> ReturningUpdate[Any]:
    """Return the statement that takes the job of a choice. Each is built once, because claims are frequent."""
    table = cast("Table", Job.__table__)
    chosen_job = choice.cte("chosen_job")
    return (
        update(table)
        .where(table.c.id == select(chosen_job.c.id).scalar_subquery(), table.c.state.in_(CLAIM.before))
        .values(
            state=CLAIM.after,
            attempt=table.c.attempt + 1,
            lease=bindparam("lease"),
            lease_until=bindparam("lease_until"),
            heartbeat_at=bindparam("current_time"),
            started_at=bindparam("current_time"),
            worker=bindparam("claimant"),
            process=bindparam("process"),
            progress=0.0,
        )
        .returning(table.c.id, table.c.attempt, table.c.max_attempts)
    )


@retry_conflicts
def renew_lease(store: Store, claim: Claim, lease_seconds: float, progress: float) -> None:
    """Renew the lease and store the progress (0 to 1). Raises LeaseLost if the worker no longer owns the job."""
    with store.transaction() as session:
        current_time = now(session)
        values = {
            "lease_until": current_time + timedelta(seconds=lease_seconds),
            "heartbeat_at": current_time,
            "progress": min(1.0, max(0.0, progress)),
        }
        _apply_owned_transition(session, HEARTBEAT, claim, current_time, values)


@retry_conflicts
def finish_job(
    store: Store,
    claim: Claim,
    prepared_grade: results.PreparedGrade,
    graded_at: datetime,
    trials_at: datetime | None = None,
) -> None:
    """Store the grade with all its rows and finish the job, in one transaction.

    ``trials_at`` and ``graded_at`` are the times when the last trial and all marking ended. Raises LeaseLost, and
    stores nothing, if the worker no longer owns the job.
    """
    # Imported here, because other operations on jobs do not read recordings.
    from service.store.grades import results

    grade = prepared_grade.grade
    with store.transaction() as session:
        current_time = now(session)
        queued_at = session.scalar(select(Job.queued_at).where(Job.id == claim.job_id))
        moments = {
            phases.QUEUED: queued_at,
            phases.CLAIMED: claim.at,
            phases.TRIALS: trials_at,
            phases.JUDGED: graded_at,
            phases.COMMITTED: current_time,
        }
        values = {
            "phases": phases.encode_times(moments),
            "graded_at": graded_at,
            "verdict": grade.verdict.value,
            "grader_version": grade.grader_version,
            "grader_sha256": hash_grader(),
            "secret_sha256": grade.secret_sha256,
            "cache_key": result_cache.compute_cache_key(session, claim.job_id, hash_grader(), grade.secret_sha256),
            "sandbox": grade.sandbox,
            "missing": grade.missing,
            "notes": list(grade.notes),
            "hints": list(grade.hints),
            "sentences": encode_sentences(grade),
            "provisional": grade.is_provisional,
            "cost": grade.cost and encode(grade.cost),
            "plots": PlotState.DUE,
            "plots_due_at": current_time,
        }
        _check_not_quarantined(session, claim)
        _apply_owned_transition(session, FINISH, claim, current_time, values)
        results.insert_grade(session, claim.job_id, prepared_grade, current_time)
        _settle_grade(session, claim.job_id, current_time)
        webhook_events.emit_grade_finished(session, claim.job_id)


@retry_conflicts
def finish_job_from_cache(store: Store, claim: Claim) -> bool:
    """Finish the job with the grade of an identical one if there is one and a new run was not requested.

    Raises LeaseLost if the worker no longer owns the job.
    """
    secret = load_secret(store)
    with store.transaction() as session:
        if session.scalar(select(Job.forced).where(Job.id == claim.job_id)):
            return False
        source = result_cache.find_cached_grade(
            session, result_cache.compute_cache_key(session, claim.job_id, hash_grader(), secret.sha256)
        )
        if source is None:
            return False
        current_time = now(session)
        _apply_owned_transition(
            session,
            FINISH,
            claim,
            current_time,
            result_cache.build_copied_values(session, source, claim.job_id, current_time),
        )
        result_cache.copy_rows(session, source, claim.job_id)
        _settle_grade(session, claim.job_id, current_time)
        webhook_events.emit_grade_finished(session, claim.job_id)
        return True


def _settle_grade(session: Session, job_id: str, current_time: datetime) -> None:
    """Compute the marks of a stored grade, and queue or apply the completion of its pools."""
    overrides.recount_marks(session, job_id)
    job = session.get_one(Job, job_id, populate_existing=True)
    if job.provisional:
        enqueue(session, pool_completions.build_completion(job), current_time)
    if job.whole_pools and job.regrade_of is not None:
        pool_completions.replace_provisional_grade(session, job, current_time)


@retry_conflicts
def fail_job(store: Store, claim: Claim, reason: str, retry: RetryPolicy) -> JobState:
    """Handle a host fault: the job is queued for another attempt, or dead after the last one.

    Raises LeaseLost if the worker no longer owns the job.
    """
    with store.transaction() as session:
        return apply_host_fault(session, claim, reason, retry, now(session))


def apply_host_fault(
    session: Session, claim: Claim, reason: str, retry: RetryPolicy, current_time: datetime
) -> JobState:
    """Handle a host fault within an open transaction, on behalf of a worker that is lost."""
    if claim.attempt >= claim.max_attempts:
        times = "once" if claim.attempt == 1 else f"{claim.attempt} times"
        _apply_owned_transition(
            session, GIVE_UP, claim, current_time, {"error": f"Tried {times}, the last time: {reason}"}
        )
        webhook_events.emit_job_ended(session, claim.job_id)
        return GIVE_UP.after
    _apply_owned_transition(
        session, TRY_AGAIN, claim, current_time, {"error": reason, "due_at": current_time + retry.wait(claim.attempt)}
    )
    return TRY_AGAIN.after


@retry_conflicts
def give_up_job(store: Store, claim: Claim, reason: str) -> None:
    """Mark a job as dead without further attempts. Raises LeaseLost if the worker no longer owns it."""
    with store.transaction() as session:
        _apply_owned_transition(session, GIVE_UP, claim, now(session), {"error": reason})
        webhook_events.emit_job_ended(session, claim.job_id)


@retry_conflicts
def release_worker(store: Store, worker: str) -> int:
    """Requeue all jobs of a worker that has ended. Return their number."""
    with store.transaction() as session:
        return requeue_worker_jobs(session, worker, now(session))


def requeue_worker_jobs(session: Session, worker: str, current_time: datetime) -> int:
    """Requeue all jobs of a worker without counting the attempt. Return their number."""
    return apply_transition(session, GIVE_BACK, (Job.worker == worker,), current_time, {"attempt": Job.attempt - 1})


def cancel_jobs(session: Session, batch_id: str, reason: str, current_time: datetime) -> int:
    """Cancel all unfinished jobs of a batch; a running job stops at its next heartbeat."""
    cancelled_count = apply_transition(session, CANCEL, (Job.batch_id == batch_id,), current_time, {"error": reason})
    if cancelled_count:
        webhook_events.emit_batch_finished(session, batch_id)
    return cancelled_count


def retry_jobs(session: Session, conditions: tuple[ColumnElement[bool], ...], current_time: datetime) -> int:
    """Requeue the dead ones among these jobs, with all their attempts. Return their number."""
    return apply_transition(session, RETRY, conditions, current_time, {"attempt": 0, "error": None})


def correct_clock(session: Session, current_time: datetime, longest_wait: Callable[[int], timedelta]) -> None:
    """Correct times that are too far ahead of ``current_time``. Repeating the correction changes nothing.

    Such times were written before the clock was set back. A clock set forward needs no correction: leases expire early
    and their workers are fenced. ``longest_wait`` returns the delay after a failed attempt. A lease keeps its length, a
    job that never failed is due now, and one that failed waits again.
    """
    latest_time = current_time + _TOLERANCE
    held_jobs = select(Job.id, Job.lease, Job.lease_until, Job.heartbeat_at)
    for job_id, lease, lease_until, heartbeat_at in session.execute(
        held_jobs.where(Job.state == JobState.RUNNING, Job.heartbeat_at > latest_time).order_by(Job.id)
    ).all():
        if lease_until is None or heartbeat_at is None:
            continue
        new_lease_end = current_time + (lease_until - heartbeat_at)
        lease_statement = update(Job).where(Job.id == job_id, Job.lease == lease)
        session.execute(lease_statement.values(heartbeat_at=current_time, lease_until=new_lease_end))
    queued_jobs = select(Job.id, Job.attempt, Job.due_at).where(Job.state == JobState.QUEUED, Job.due_at > latest_time)
    for job_id, attempt, due_at in session.execute(queued_jobs.order_by(Job.id)).all():
        latest_due = current_time + longest_wait(attempt) if attempt else current_time
        if due_at > latest_due + _TOLERANCE:
            is_held_back = (Job.id == job_id, Job.state == JobState.QUEUED)
            session.execute(update(Job).where(*is_held_back).values(due_at=latest_due, notified_at=None))
    is_notified_later = (Job.state == JobState.QUEUED, Job.notified_at > latest_time)
    session.execute(
        update(Job).where(match_and_lock_jobs(*is_notified_later), *is_notified_later).values(notified_at=None)
    )
    plots.correct_due_times(session, current_time, latest_time)


def _apply_owned_transition(
    session: Session, transition: Transition, claim: Claim, current_time: datetime, values: dict[str, Any]
) -> None:
    """Apply the transition to an owned job. Raises LeaseLost if the worker no longer owns it."""
    if not apply_transition(
        session, transition, (Job.id == claim.job_id, Job.lease == claim.lease), current_time, values
    ):
        state = session.scalar(select(Job.state).where(Job.id == claim.job_id))
        if state is None:
            raise HostError(f"The job {claim.job_id} is gone from the database")
        raise LeaseLost(f"The job {claim.job_id} is no longer this worker's: it is {state.value}")


def _check_not_quarantined(session: Session, claim: Claim) -> None:
    is_owned = (Job.id == claim.job_id, Job.lease == claim.lease, Job.state == JobState.RUNNING)
    worker = session.scalar(select(Job.worker).where(*is_owned))
    if worker is not None and workers.is_in_quarantine(session, worker, lock=True):
        raise LeaseLost(f"The job {claim.job_id} is no longer this worker's: the worker is in quarantine")
