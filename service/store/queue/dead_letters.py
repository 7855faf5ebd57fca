"""Failed jobs of the installation, for operators. Read-only; ``batch_control`` retries them."""

from __future__ import annotations

from dataclasses import dataclass
from datetime import datetime

from sqlalchemy import select
from sqlalchemy.orm import Session

from service.store.states import JobQueue, JobState
from service.store.tables.courses import Course
from service.store.tables.people import Enrolment
from service.store.tables.submissions import Batch, Job

#: Maximum number listed, newest first.
MAX_LISTED = 100


@dataclass(frozen=True, slots=True)
class DeadLetter:
    """A job that was given up."""

    job_id: str
    course: str
    batch_id: str | None
    batch: str  # its name
    lane: JobQueue
    error: str
    attempts: int
    worker: str
    finished_at: datetime | None


def list_dead_letters(session: Session) -> list[DeadLetter]:
    """Return the failed jobs, newest first."""
    query = (
        select(Job, Course.name, Batch.name)
        .join(Enrolment, Job.enrolment_id == Enrolment.id)
        .join(Course, Enrolment.course_id == Course.id)
        .outerjoin(Batch, Job.batch_id == Batch.id)
        .where(Job.state == JobState.DEAD)
        .order_by(Job.finished_at.desc(), Job.id)
        .limit(MAX_LISTED)
    )
    return [
        DeadLetter(
            job.id,
            course,
            job.batch_id,
            batch or "",
            job.lane,
            job.error or "",
            job.attempt,
            job.worker or "",
            job.finished_at,
        )
        for job, course, batch in session.execute(query)
    ]
