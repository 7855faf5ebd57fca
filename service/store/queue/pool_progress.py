"""Progress of a provisional grade towards an exact one, and completions for which a student waits.

``pool_completions.py`` defines what a completion is and what its grade replaces.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from datetime import datetime
from typing import Any

from sqlalchemy import func, select
from sqlalchemy.orm import Session

from service.store.locks import lock_submissions
from service.store.queue.jobs import enqueue
from service.store.queue.pool_completions import build_completion, is_always_replaced
from service.store.states import UNFINISHED, JobQueue, JobState, Standing
from service.store.tables.grades import CriterionResultRow
from service.store.tables.submissions import Job, SubmissionRow
from sim.errors import UsageError

#: Estimates that students see. Exact ones would tell them in how many hidden trials a program computed for long.
_STUDENTS_SECONDS = (60, 300, 1800)


@dataclass(frozen=True, slots=True)
class PoolProgress:
    """Whether the marks of a grade are exact, and otherwise the completion that makes them exact.

    ``seconds`` is an upper estimate of the CPU time of all trials. ``is_expedited`` says whether somebody waits for it.
    ``can_decrease`` says whether lower exact marks would replace these.
    """

    is_exact: bool
    is_expedited: bool = False
    seconds: int = 0
    can_decrease: bool = False


def load_progress(session: Session, submission_id: int) -> PoolProgress | None:
    """Return the progress of the standing grade of a submission.

    None if there is no grade, if it depends on no pool, or if it was published and its exact grade is lower.
    """
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
    if _has_lower_exact_grade(session, job.id):
        return None
    completion = _find_completion(session, job.id)
    is_expedited = completion is not None and completion.lane is JobQueue.INTERACTIVE
    can_decrease = job.published_at is None or is_always_replaced(session, job)
    seconds = _estimate_seconds(job, pools)
    shown_seconds = next((each for each in _STUDENTS_SECONDS if seconds <= each), 3600)
    return PoolProgress(False, is_expedited, shown_seconds, can_decrease)


def estimate_completion_seconds(session: Session, provisional_jobs: Sequence[Job]) -> float:
    """Return the estimated CPU time of all trials of these provisional grades."""
    jobs_by_id = {job.id: job for job in provisional_jobs}
    query = select(CriterionResultRow.job_id, CriterionResultRow.pool)
    pools_by_job: dict[str, list[Any]] = {}
    for job_id, pool in session.execute(query.where(CriterionResultRow.job_id.in_(jobs_by_id))):
        if pool is not None:
            pools_by_job.setdefault(job_id, []).append(pool)
    return sum(_estimate_seconds(jobs_by_id[job_id], pools) for job_id, pools in pools_by_job.items())


def _estimate_seconds(job: Job, pools: Sequence[Any]) -> float:
    """Return the CPU time of all trials, if the others take as long as those that were run."""
    spent_seconds: float = ((job.cost or {}).get("spent") or {}).get("cpu_seconds", 0.0)
    shares = [float(pool["drawn"]) / float(pool["size"]) for pool in pools if pool["drawn"]]
    return spent_seconds / min(shares, default=1.0)


def expedite(session: Session, submission_id: int, enrolment_id: int, current_time: datetime) -> None:
    """Run the completion of the standing grade of a submission as soon as possible, for its student.

    A completion that was given up or cancelled is queued again.

    Raises:
        UsageError: All trials were run already, or the student waits for a completion.
    """
    lock_submissions(session, SubmissionRow.enrolment_id == enrolment_id)
    query = select(Job).where(Job.submission_id == submission_id, Job.standing == Standing.STANDS, Job.provisional)
    job = session.scalars(query).first()
    if job is None:
        raise UsageError("these marks are exact already: all trials were run")
    if _has_lower_exact_grade(session, job.id):
        raise UsageError("all trials were run already; your published marks stay, because they are higher")
    if _count_expedited(session, enrolment_id):
        raise UsageError("all trials of one of your grades are being run; wait for the result")
    completion = _find_completion(session, job.id)
    if completion is None:
        completion = build_completion(job)
        enqueue(session, completion, current_time)
    completion.lane, completion.notified_at = JobQueue.INTERACTIVE, None


def _has_lower_exact_grade(session: Session, job_id: str) -> bool:
    """Return whether a completion of this standing grade ended and did not replace it."""
    query = select(Job.id).where(Job.regrade_of == job_id, Job.whole_pools, Job.state == JobState.DONE)
    return session.scalar(query.limit(1)) is not None


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
