"""Regrades after a change of an assignment or the grader: queues them.

Old grades are in effect until the new ones are published (``publishing.py``). ``regrade_changes.py`` compares both.
Nothing is graded here. ``service.operations.regrades`` owns the transactions.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from datetime import datetime
from decimal import Decimal

from sqlalchemy import select
from sqlalchemy.orm import Session

from service.store.batches import batches
from service.store.courses.assignment_versions import FrozenAssignment, store_version
from service.store.engine import now
from service.store.queue.jobs import enqueue
from service.store.states import UNFINISHED, JobQueue, JobState, Standing
from service.store.tables.courses import AssignmentVersion
from service.store.tables.submissions import Batch, Job
from sim.errors import UsageError


@dataclass(frozen=True, slots=True)
class RegradeBatch:
    """A batch of regrades, with the number of submissions left out: other assignment, or not graded yet."""

    batch_id: str
    jobs: int
    other_assignment: int
    unfinished: int


@dataclass(frozen=True, slots=True)
class GradingLine:
    """One grading of a submission."""

    id: str
    state: JobState
    standing: Standing
    marks: Decimal | None
    max_marks: Decimal | None
    queued_at: datetime
    published_at: datetime | None


def queue_regrades(
    session: Session, original: Batch, frozen_assignment: FrozenAssignment | None, *, max_attempts: int
) -> RegradeBatch:
    """Queue a regrade of every submission of the batch that was graded or failed.

    Uses the assignment version ``frozen_assignment``, or else the version that each was graded against. Standing grades
    are not changed. Raises UsageError if there is nothing to grade again.
    """
    current_time = now(session)
    standing_jobs = _load_standing_jobs(session, original.id)
    ended_jobs = [row for row in standing_jobs if row[0].state in (JobState.DONE, JobState.DEAD)]
    selected_jobs = [
        job for job, name in ended_jobs if frozen_assignment is None or name == frozen_assignment.assignment.id
    ]
    unfinished_count = sum(job.state in UNFINISHED for job, _ in standing_jobs)
    if not selected_jobs:
        raise UsageError(
            _describe_empty_regrade(
                original.id, frozen_assignment, {name for _, name in standing_jobs}, unfinished_count
            )
        )
    version_id = None if frozen_assignment is None else store_version(session, frozen_assignment, current_time)
    batch = Batch(
        course_id=original.course_id,
        name=f"regrade of {original.name}",
        refusals=[],
        regrade_of=original.id,
        created_at=current_time,
    )
    session.add(batch)
    session.flush()
    for job in selected_jobs:
        enqueue(session, _build_proposal(job, version_id, batch.id, JobQueue.BATCH, max_attempts), current_time)
    return RegradeBatch(batch.id, len(selected_jobs), len(ended_jobs) - len(selected_jobs), unfinished_count)


def queue_regrade(
    session: Session, requested_job: Job, frozen_assignment: FrozenAssignment | None, *, max_attempts: int
) -> Job:
    """Queue an interactive regrade of one submission and return the new job.

    ``frozen_assignment`` as in ``regrade``. Raises UsageError if there is no grade yet, or for another assignment.
    """
    current_time = now(session)
    is_standing = (Job.submission_id == requested_job.submission_id, Job.standing == Standing.STANDS)
    standing_jobs = session.scalars(select(Job).where(*is_standing).order_by(Job.queued_at, Job.id)).all()
    ended_jobs = [job for job in standing_jobs if job.state in (JobState.DONE, JobState.DEAD)]
    if not ended_jobs:
        raise UsageError("this submission is not graded yet")
    name = session.get_one(AssignmentVersion, ended_jobs[-1].assignment_version_id).assignment
    if frozen_assignment is not None and frozen_assignment.assignment.id != name:
        raise UsageError(f"this submission is for {name}, not for {frozen_assignment.assignment.id}")
    version_id = None if frozen_assignment is None else store_version(session, frozen_assignment, current_time)
    proposal = _build_proposal(ended_jobs[-1], version_id, None, JobQueue.INTERACTIVE, max_attempts)
    enqueue(session, proposal, current_time)
    session.flush()
    return proposal


def load_gradings(session: Session, submission_id: int) -> list[GradingLine]:
    """Return all gradings of a submission, oldest first, without those of quarantined workers."""
    is_grading = (Job.submission_id == submission_id, Job.suspect.is_(None))
    rows = session.scalars(select(Job).where(*is_grading).order_by(Job.queued_at, Job.id))
    return [
        GradingLine(row.id, row.state, row.standing, row.marks, row.max_marks, row.queued_at, row.published_at)
        for row in rows
    ]


def _load_standing_jobs(session: Session, batch_id: str) -> Sequence[tuple[Job, str]]:
    """Return the standing jobs of the submissions of a batch, with their assignments."""
    query = (
        select(Job, AssignmentVersion.assignment)
        .join(AssignmentVersion, Job.assignment_version_id == AssignmentVersion.id)
        .where(Job.submission_id.in_(batches.select_submissions(session, batch_id)), Job.standing == Standing.STANDS)
        .order_by(Job.queued_at, Job.id)
    )
    return [(job, name) for job, name in session.execute(query)]


def _describe_empty_regrade(
    batch_id: str, frozen_assignment: FrozenAssignment | None, assignment_names: set[str], unfinished_count: int
) -> str:
    if frozen_assignment is not None and assignment_names and frozen_assignment.assignment.id not in assignment_names:
        return (
            f"batch {batch_id} has no submission for {frozen_assignment.assignment.id}, only for "
            f"{', '.join(sorted(assignment_names))}"
        )
    unfinished_note = f": {unfinished_count} of its submissions are not graded yet" if unfinished_count else ""
    return f"batch {batch_id} has nothing to grade again{unfinished_note}"


def _build_proposal(job: Job, version_id: int | None, batch_id: str | None, lane: JobQueue, max_attempts: int) -> Job:
    return Job(
        submission_id=job.submission_id,
        assignment_version_id=version_id or job.assignment_version_id,
        enrolment_id=job.enrolment_id,
        batch_id=batch_id,
        lane=lane,
        max_attempts=max_attempts,
        forced=True,
        regrade_of=job.id,
        standing=Standing.PROPOSED,
    )
