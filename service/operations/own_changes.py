"""Changes of marks that a student has seen: the published grade that the current one replaced, and why."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass
from datetime import datetime
from decimal import Decimal
from enum import StrEnum

from sqlalchemy import select
from sqlalchemy.orm import Session

from service.grading.grade import Grade
from service.reports.view import build_student_view
from service.store.courses import policies
from service.store.grades import results
from service.store.states import JobState, Standing
from service.store.tables.submissions import Job


class ChangeReason(StrEnum):
    """Why a published grade was replaced, in what differs between the two gradings."""

    ASSIGNMENT = "assignment"  # another version of the assignment
    POOL = "pool"  # all trials were run
    GRADER = "grader"  # another release of the grader
    AGAIN = "again"  # none of these


@dataclass(frozen=True, slots=True)
class MarksChange:
    """The visible marks of a published grade before it was replaced. They can equal the new ones."""

    marks: Decimal
    max_marks: Decimal
    changed_at: datetime
    reason: ChangeReason


def load_changes(session: Session, submission_ids: Collection[int]) -> dict[int, MarksChange]:
    """Return the published grade that the current published one replaced last, by submission id.

    The student must be allowed to see the current grade of each submission.
    """
    query = select(Job).where(
        Job.submission_id.in_(submission_ids),
        Job.published_at.is_not(None),
        Job.state == JobState.DONE,
        Job.standing.in_((Standing.STANDS, Standing.KEPT)),
    )
    standing_jobs: dict[int, Job] = {}
    earlier_jobs: dict[int, Job] = {}
    for job in session.scalars(query.order_by(Job.published_at, Job.queued_at, Job.id)):
        jobs = standing_jobs if job.standing is Standing.STANDS else earlier_jobs
        jobs[job.submission_id] = job
    replaced = [(job, standing_jobs[id_]) for id_, job in earlier_jobs.items() if id_ in standing_jobs]
    if not replaced:
        return {}
    earlier_ids = [earlier_job.id for earlier_job, _ in replaced]
    grades = results.load_marks(session, earlier_ids)
    visibilities = policies.load_visibilities_by_job(session, earlier_ids)
    return {
        job.submission_id: _build_change(earlier_job, job, grades[earlier_job.id], visibilities[earlier_job.id])
        for earlier_job, job in replaced
        if earlier_job.id in grades
    }


def _build_change(earlier_job: Job, job: Job, earlier_grade: Grade, visibilities: frozenset[str]) -> MarksChange:
    earlier = build_student_view(earlier_grade, visibilities).grade
    changed_at = job.published_at or job.queued_at
    return MarksChange(earlier.marks, earlier.max_marks, changed_at, _find_reason(earlier_job, job))


def _find_reason(earlier_job: Job, job: Job) -> ChangeReason:
    if earlier_job.assignment_version_id != job.assignment_version_id:
        return ChangeReason.ASSIGNMENT
    if job.whole_pools and not earlier_job.whole_pools:
        return ChangeReason.POOL
    if earlier_job.grader_sha256 != job.grader_sha256:
        return ChangeReason.GRADER
    return ChangeReason.AGAIN
