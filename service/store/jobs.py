"""What may happen to a job: claimed, kept alive, finished, failed, given back, cancelled.

A worker holds a job by its lease's token, and every change it makes is refused once the token is no longer the job's.
Which job is due first stands in ``scheduling.py``; finding lost ones in ``lease_reaper.py``.
"""

from __future__ import annotations

import os
import secrets
from collections.abc import Sequence
from dataclasses import dataclass
from datetime import datetime, timedelta
from typing import Any, cast

from sqlalchemy import CursorResult, Update, select, update
from sqlalchemy.orm import Session

from service.store import artifacts, grades, phases, result_cache, self_tests
from service.store.codec import encode
from service.store.engine import Store, now
from service.store.installation import secret_of
from service.store.models import UNFINISHED, Job, JobState, PlotState
from service.store.scheduling import next_job
from service.version import grader_sha256
from sim.errors import Cancelled, HostError

PLOT_ATTEMPTS = 3
_LONGEST_BACKOFF = timedelta(hours=1)


class Fenced(Cancelled):
    """The job is no longer this worker's: cancelled, or another has it."""


@dataclass(frozen=True, slots=True)
class Claim:
    """A job in the hands of one worker."""

    job_id: str
    lease: str
    attempt: int  # 1 is the first
    at: datetime  # the database's clock when it was claimed


@dataclass(frozen=True, slots=True)
class Retry:
    """How often a job is tried again after a fault of ours, and how long it waits: doubling from ``backoff``."""

    backoff_seconds: float

    def wait(self, attempt: int) -> timedelta:
        """Before the attempt after number ``attempt`` (1 is the first)."""
        return min(timedelta(seconds=self.backoff_seconds * 2.0 ** min(attempt - 1, 20)), _LONGEST_BACKOFF)


def claim(store: Store, worker: str, lease_seconds: float) -> Claim | None:
    """Take the job whose turn it is; None when none is due."""
    with store.transaction() as session:
        at = now(session)
        job_id = None if self_tests.is_in_quarantine(session, worker) else next_job(session, at, worker)
        if job_id is None:
            return None
        begun = session.scalars(select(Job.attempt).where(Job.id == job_id)).one()
        claimed = Claim(job_id, secrets.token_hex(16), begun + 1, at)
        taken = _change(
            session,
            update(Job)
            .where(Job.id == job_id, Job.state == JobState.QUEUED)
            .values(
                state=JobState.RUNNING,
                attempt=Job.attempt + 1,
                lease=claimed.lease,
                lease_until=at + timedelta(seconds=lease_seconds),
                heartbeat_at=at,
                started_at=at,
                worker=worker,
                process=os.getpid(),
                progress=0.0,
            ),
        )
        return claimed if taken else None


def heartbeat(store: Store, claim: Claim, lease_seconds: float, progress: float) -> None:
    """Keep the lease and tell the progress (0 to 1). Raises Fenced when the job is no longer this worker's."""
    with store.transaction() as session:
        at = now(session)
        values = {
            "lease_until": at + timedelta(seconds=lease_seconds),
            "heartbeat_at": at,
            "progress": min(1.0, max(0.0, progress)),
        }
        _guarded(session, claim, values)


def finish(
    store: Store,
    claim: Claim,
    prepared: grades.Prepared,
    graded_at: datetime,
    trials_at: datetime | None = None,
) -> None:
    """Store the grade with all its rows and end the job, in one transaction.

    ``trials_at`` and ``graded_at`` are when the last trial had been run and when all was marked. Raises Fenced, and
    stores nothing, when the job is no longer this worker's.
    """
    grade = prepared.grade
    with store.transaction() as session:
        at = now(session)
        queued_at = session.scalar(select(Job.queued_at).where(Job.id == claim.job_id))
        moments = {
            phases.QUEUED: queued_at,
            phases.CLAIMED: claim.at,
            phases.TRIALS: trials_at,
            phases.JUDGED: graded_at,
            phases.COMMITTED: at,
        }
        values = {
            "phases": phases.written(moments),
            "state": JobState.DONE,
            "lease": None,
            "lease_until": None,
            "progress": 1.0,
            "error": None,
            "graded_at": graded_at,
            "finished_at": at,
            "verdict": grade.verdict.value,
            "marks": grade.marks,
            "max_marks": grade.max_marks,
            "grader_version": grade.grader_version,
            "grader_sha256": grader_sha256(),
            "secret_sha256": grade.secret_sha256,
            "cache_key": result_cache.cache_key(session, claim.job_id, grader_sha256(), grade.secret_sha256),
            "sandbox": grade.sandbox,
            "notes": list(grade.notes),
            "cost": grade.cost and encode(grade.cost),
            "plots": PlotState.DUE,
            "plots_due_at": at,
        }
        _refuse_quarantined(session, claim)
        _guarded(session, claim, values)
        grades.insert(session, claim.job_id, prepared, at)


def finish_from_cache(store: Store, claim: Claim) -> bool:
    """End the job with the grade of an identical one, where there is one and nobody asked for it to be run anew.

    Raises Fenced when the job is no longer this worker's.
    """
    secret = secret_of(store)
    with store.transaction() as session:
        if session.scalar(select(Job.forced).where(Job.id == claim.job_id)):
            return False
        source = result_cache.find(
            session, result_cache.cache_key(session, claim.job_id, grader_sha256(), secret.sha256)
        )
        if source is None:
            return False
        at = now(session)
        _guarded(session, claim, {"heartbeat_at": at})
        _guarded(session, claim, result_cache.copy(session, source, claim.job_id, at))
        return True


def fail(store: Store, claim: Claim, reason: str, retry: Retry) -> JobState:
    """A fault of ours: the job waits for another attempt, or is dead when there were enough.

    Raises Fenced when the job is no longer this worker's.
    """
    with store.transaction() as session:
        at = now(session)
        job = session.scalars(select(Job).where(Job.id == claim.job_id)).one()
        values = after_fault(job.attempt, job.max_attempts, reason, retry, at)
        _guarded(session, claim, values)
        return cast(JobState, values["state"])


def give_up(store: Store, claim: Claim, reason: str) -> None:
    """The job cannot be graded, however often it is tried. Raises Fenced when it is no longer this worker's."""
    with store.transaction() as session:
        _guarded(session, claim, _ended(JobState.DEAD, now(session)) | {"error": reason})


def release(store: Store, claim: Claim) -> None:
    """Give the job back as if it had not been begun. Does nothing when it is no longer this worker's."""
    with store.transaction() as session:
        _change(session, update(Job).where(*_held(claim)).values(**_given_back(now(session))))


def release_worker(store: Store, worker: str) -> int:
    """Give back all that a worker held, one that is known to have ended. Returns how many jobs that were."""
    with store.transaction() as session:
        held = (Job.state == JobState.RUNNING, Job.worker == worker)
        return _change(session, update(Job).where(*held).values(**_given_back(now(session))))


def cancel(store: Store, job_ids: Sequence[str]) -> int:
    """Stop jobs that have not ended; a worker that runs one is told at its next heartbeat. Returns how many."""
    with store.transaction() as session:
        ended = _ended(JobState.CANCELLED, now(session))
        open_jobs = (Job.id.in_(job_ids), Job.state.in_(UNFINISHED))
        return _change(session, update(Job).where(*open_jobs).values(**ended))


def claim_plots(store: Store, lease_seconds: float) -> str | None:
    """The job whose plots are drawn next, by age; None when none is due.

    Drawing twice does no harm, so the claim is only put off, not fenced. After three times it is given up.
    """
    with store.transaction() as session:
        at = now(session)
        due = (Job.plots == PlotState.DUE, Job.plots_due_at <= at)
        given_up = update(Job).where(*due, Job.plots_attempt >= PLOT_ATTEMPTS).values(plots=PlotState.FAILED)
        session.execute(given_up)
        query = select(Job.id).where(*due).order_by(Job.finished_at, Job.id).limit(1)
        job_id = session.scalar(query.with_for_update(skip_locked=True))
        if job_id is not None:
            until = at + timedelta(seconds=lease_seconds)
            values = {"plots_due_at": until, "plots_attempt": Job.plots_attempt + 1}
            session.execute(update(Job).where(Job.id == job_id).values(**values))
        return job_id


def finish_plots(store: Store, job_id: str, files: list[artifacts.File]) -> None:
    """Keep the plots of a job."""
    with store.transaction() as session:
        at = now(session)
        artifacts.put(session, job_id, files, at)
        before = session.scalars(select(Job.phases).where(Job.id == job_id)).one()
        reached = {**before, **phases.written({phases.PLOTTED: at})}
        done = {"plots": PlotState.DONE, "plots_due_at": None, "plotted_at": at, "phases": reached}
        session.execute(update(Job).where(Job.id == job_id).values(**done))


def after_fault(attempt: int, max_attempts: int, reason: str, retry: Retry, at: datetime) -> dict[str, Any]:
    """The columns of a job after a fault of ours in attempt number ``attempt``."""
    if attempt >= max_attempts:
        times = "once" if attempt == 1 else f"{attempt} times"
        return _ended(JobState.DEAD, at) | {"error": f"Tried {times}, the last time: {reason}"}
    waiting = {"state": JobState.QUEUED, "lease": None, "lease_until": None, "notified_at": None}
    return waiting | {"progress": 0.0, "error": reason, "due_at": at + retry.wait(attempt)}


def _ended(state: JobState, at: datetime) -> dict[str, Any]:
    return {"state": state, "lease": None, "lease_until": None, "finished_at": at}


def _given_back(at: datetime) -> dict[str, Any]:
    waiting = {"state": JobState.QUEUED, "lease": None, "lease_until": None, "notified_at": None}
    return waiting | {"progress": 0.0, "due_at": at, "attempt": Job.attempt - 1}


def _held(claim: Claim) -> tuple[Any, ...]:
    return Job.id == claim.job_id, Job.lease == claim.lease, Job.state == JobState.RUNNING


def _refuse_quarantined(session: Session, claim: Claim) -> None:
    worker = session.scalar(select(Job.worker).where(*_held(claim)))
    if worker is not None and self_tests.is_in_quarantine(session, worker, lock=True):
        raise Fenced(f"The job {claim.job_id} is no longer this worker's: the worker is in quarantine")


def _guarded(session: Session, claim: Claim, values: dict[str, Any]) -> None:
    if not _change(session, update(Job).where(*_held(claim)).values(**values)):
        state = session.scalar(select(Job.state).where(Job.id == claim.job_id))
        if state is None:
            raise HostError(f"The job {claim.job_id} is gone from the database")
        raise Fenced(f"The job {claim.job_id} is no longer this worker's: it is {state.value}")


def _change(session: Session, statement: Update) -> int:
    options = {"synchronize_session": False}
    return cast("CursorResult[Any]", session.execute(statement, execution_options=options)).rowcount
