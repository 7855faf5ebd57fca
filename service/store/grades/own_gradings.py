"""Grades of one person in a course, newest first. Read-only; the caller checks permission."""

from __future__ import annotations

from dataclasses import dataclass
from datetime import datetime
from decimal import Decimal

from sqlalchemy import select
from sqlalchemy.orm import Session

from service.store.states import JobState, Standing
from service.store.tables.submissions import Job, SubmissionRow

_MAX_LISTED = 50


@dataclass(frozen=True, slots=True)
class OwnGrading:
    """The standing grade of one submission."""

    job_id: str
    assignment: str
    attempt: int
    state: JobState
    marks: Decimal | None
    max_marks: Decimal | None
    queued_at: datetime
    published_at: datetime | None


def list_newest_gradings(session: Session, enrolment_id: int, assignment: str = "") -> list[OwnGrading]:
    """Return the newest grades of one person, for one assignment or for all."""
    query = (
        select(Job, SubmissionRow.assignment, SubmissionRow.attempt)
        .join(SubmissionRow, Job.submission_id == SubmissionRow.id)
        .where(Job.enrolment_id == enrolment_id, Job.standing == Standing.STANDS)
        .order_by(Job.queued_at.desc(), Job.id)
        .limit(_MAX_LISTED)
    )
    if assignment:
        query = query.where(SubmissionRow.assignment == assignment)
    return [
        OwnGrading(job.id, name, attempt, job.state, job.marks, job.max_marks, job.queued_at, job.published_at)
        for job, name, attempt in session.execute(query)
    ]
