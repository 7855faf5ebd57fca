"""Progress of a provisional grade towards an exact one, and completions for which a student waits.

``pool_completions.py`` defines what a completion is and what its grade replaces.
"""

from __future__ import annotations

from dataclasses import dataclass
from datetime import datetime

from sqlalchemy import func, select
from sqlalchemy.orm import Session

from service.store.locks import lock_submissions
from service.store.queue.jobs import enqueue
from service.store.queue.pool_completions import build_completion
from service.store.states import UNFINISHED, JobQueue, JobState, Standing
from service.store.tables.grades import CriterionResultRow
from service.store.tables.submissions import Job, SubmissionRow
from sim.errors import UsageError


@dataclass(frozen=True, slots=True)
class PoolProgress:
    """Whether the marks of a grade are exact, and otherwise the completion that makes them exact.

    ``seconds`` is the estimated CPU time of all trials. ``is_expedited`` says whether somebody waits for it.
    """

    is_exact: bool
    is_expedited: bool = False
    seconds: float = 0.0


def load_progress(session: Session, submission_id: int) -> PoolProgress | None:
    """Return the progress of the standing grade of a submission; None if it depends on no pool or does not exist."""
    query = select(Job).where(Job.submission_id == submission_id, Job.standing == Standing.STANDS)
    job = session.scalars(query).first()
    if job is None or job.state != JobState.DONE:
        return None
    rows = select(CriterionResultRow.pool).where(CriterionResultRow.job_id == job.id)
    pools = [pool for pool in session.scalars(rows) if pool is not None]
    if not pools:
        return None
    if not job.provisional:
        return PoolProgress(True)
    completion = _find_completion(session, job.id)
    spent_seconds = ((job.cost or {}).get("spent") or {}).get("cpu_seconds", 0.0)
    seconds = spent_seconds * max(pool["size"] / max(1, pool["drawn"]) for pool in pools)
    return PoolProgress(False, completion is not None and completion.lane is JobQueue.INTERACTIVE, seconds)


def expedite(
    session: Session, submission_id: int, enrolment_id: int, max_attempts: int, current_time: datetime
) -> None:
    """Run the completion of the standing grade of a submission as soon as possible, for its student.

    A completion that was given up or cancelled is queued again.

    Raises:
        UsageError: The grade is not provisional, or the student already waits for a completion.
    """
    lock_submissions(session, SubmissionRow.enrolment_id == enrolment_id)
    query = select(Job).where(Job.submission_id == submission_id, Job.standing == Standing.STANDS, Job.provisional)
    job = session.scalars(query).first()
    if job is None:
        raise UsageError("these marks are exact already: all trials were run")
    if _count_expedited(session, enrolment_id):
        raise UsageError("all trials of one of your grades are being run; wait for the result")
    completion = _find_completion(session, job.id)
    if completion is None:
        completion = build_completion(job)
        completion.max_attempts = max_attempts
        enqueue(session, completion, current_time)
    completion.lane, completion.notified_at = JobQueue.INTERACTIVE, None


def _find_completion(session: Session, job_id: str) -> Job | None:
    """Return the unfinished completion of a grade; None if it has none."""
    query = select(Job).where(Job.regrade_of == job_id, Job.whole_pools, Job.state.in_(UNFINISHED))
    return session.scalars(query.order_by(Job.queued_at.desc()).limit(1)).first()


def _count_expedited(session: Session, enrolment_id: int) -> int:
    """Return the number of unfinished completions for which this student waits."""
    query = select(func.count()).where(
        Job.enrolment_id == enrolment_id,
        Job.whole_pools,
        Job.state.in_(UNFINISHED),
        Job.lane == JobQueue.INTERACTIVE,
    )
    return session.scalar(query) or 0
