"""Queries about batches: their lines in a list, their progress, and the submissions that they show. Read-only.

``job_lines.py`` reads the rows of a batch.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from datetime import datetime
from typing import Any

from sqlalchemy import Select, and_, func, or_, select
from sqlalchemy.orm import InstrumentedAttribute, Session, aliased

from service.store.codec import decode
from service.store.grades import current_grades
from service.store.states import UNFINISHED, BatchState, JobState, PlotState, Standing
from service.store.tables.courses import OpenAssignment
from service.store.tables.submissions import Batch, Job, SubmissionRow
from sim.errors import UsageError
from submissions.student_identity import RejectedSubmission
from submissions.suggestions import suggest_name

_MAX_LISTED = 50
#: Number of newest ids considered for a "did you mean" hint.
_MAX_COMPARED = 1000


@dataclass(frozen=True, slots=True)
class BatchLine:
    """A batch, with the number of jobs in each state."""

    id: str
    name: str
    state: BatchState
    created_at: datetime
    refusals: tuple[RejectedSubmission, ...]
    jobs: int
    states: dict[JobState, int]
    regrade_of: str | None  # the batch that was graded again
    web_assignment: str | None  # the assignment of a batch of web submissions
    takes_in: bool  # the assignment is open, so more submissions may arrive

    @property
    def unfinished(self) -> int:
        """Number of its jobs that have not ended."""
        return sum(self.states.get(state, 0) for state in UNFINISHED)


@dataclass(frozen=True, slots=True)
class BatchProgress:
    """Progress of some jobs; ``partial`` is the work done by the running ones, in jobs."""

    jobs: int
    ended: int
    partial: float
    plots_due: int


def find_batch(session: Session, start: str) -> str:
    """Return the id of the batch that begins with ``start``. Raises UsageError for no match or several."""
    return _find_by_prefix(session, Batch.id, Batch.created_at, start, "batch")


def find_job(session: Session, start: str) -> str:
    """Return the id of the job that begins with ``start``. Raises UsageError for no match or several."""
    return _find_by_prefix(session, Job.id, Job.queued_at, start, "grade")


def find_previous_job(session: Session, job_id: str) -> str:
    """Return the id of the standing grade of the same student's previous attempt.

    Skips staff-only and untrusted grades. Raises UsageError if there is none.
    """
    submission = session.execute(
        select(SubmissionRow).join(Job, Job.submission_id == SubmissionRow.id).where(Job.id == job_id)
    ).scalar_one()
    previous_id = session.scalar(
        select(Job.id)
        .join(SubmissionRow, Job.submission_id == SubmissionRow.id)
        .where(
            SubmissionRow.enrolment_id == submission.enrolment_id,
            SubmissionRow.assignment == submission.assignment,
            SubmissionRow.attempt < submission.attempt,
            *current_grades.CAN_COUNT,
        )
        .order_by(SubmissionRow.attempt.desc())
        .limit(1)
    )
    if previous_id is None:
        raise UsageError(f"no grade of the same student for the same assignment comes before {job_id}")
    return previous_id


def list_batches(session: Session, course_id: int | None = None) -> list[BatchLine]:
    """Return the newest batches, newest first, of all courses or of one."""
    query = select(Batch).order_by(Batch.created_at.desc(), Batch.id).limit(_MAX_LISTED)
    if course_id is not None:
        query = query.where(Batch.course_id == course_id)
    return _build_batch_lines(session, session.scalars(query).all())


def list_course_batches(
    session: Session, course_id: int, limit: int, cursor: tuple[datetime, str] | None
) -> list[BatchLine]:
    """Return the next ``limit`` batches of a course, newest first, after the batch with this creation time and id."""
    query = select(Batch).where(Batch.course_id == course_id)
    if cursor is not None:
        same_time = and_(Batch.created_at == cursor[0], Batch.id > cursor[1])
        query = query.where(or_(Batch.created_at < cursor[0], same_time))
    rows = session.scalars(query.order_by(Batch.created_at.desc(), Batch.id).limit(limit)).all()
    return _build_batch_lines(session, rows)


def load_batch(session: Session, batch_id: str) -> BatchLine:
    """Return one batch. Raises UsageError if the id is unknown."""
    row = session.get(Batch, batch_id)
    if row is None:
        raise UsageError(f"there is no batch {batch_id}")
    return _build_batch_lines(session, [row])[0]


def is_regrade(session: Session, batch_id: str) -> bool:
    """Return whether a batch consists of regrades. Needs no query if the caller keeps the batch row."""
    row = session.get(Batch, batch_id)
    return row is not None and row.regrade_of is not None


def select_submissions(session: Session, batch_id: str) -> Select[int]:
    """Return a query for the submissions of a batch: the current ones, or all in a batch of regrades."""
    if is_regrade(session, batch_id):
        return select(Job.submission_id).where(Job.batch_id == batch_id)
    return select_shown_submissions([batch_id])


def select_shown_submissions(batch_ids: Sequence[str]) -> Select[int]:
    """Return a query for the submissions that the rows of some batches show: the current attempt of each student."""
    return current_grades.select_shown_submissions(
        current_grades.match_students_of_batches(select(Batch.id).where(Batch.id.in_(batch_ids)))
    )


def load_progress(session: Session, batch_id: str) -> BatchProgress:
    """Return the progress of a batch."""
    is_in_batch = Job.batch_id == batch_id
    states = dict(session.execute(select(Job.state, func.count()).where(is_in_batch).group_by(Job.state)).all())
    running_progress = select(func.sum(Job.progress)).where(is_in_batch, Job.state == JobState.RUNNING)
    due_plots = select(func.count()).select_from(Job).where(is_in_batch, Job.plots == PlotState.DUE)
    return BatchProgress(
        jobs=sum(states.values()),
        ended=sum(count for state, count in states.items() if state not in UNFINISHED),
        partial=session.scalar(running_progress) or 0.0,
        plots_due=session.scalar(due_plots) or 0,
    )


def _build_batch_lines(session: Session, rows: Sequence[Batch]) -> list[BatchLine]:
    batch_ids = [row.id for row in rows]
    open_assignments = session.scalars(select(OpenAssignment).where(OpenAssignment.batch_id.in_(batch_ids)))
    web_assignments = {row.batch_id: row for row in open_assignments if row.batch_id is not None}
    # Submissions graded by a quarantined worker have a second job in the batch.
    job_counts = select(Job.batch_id, Job.state, func.count()).where(
        Job.batch_id.in_([own for own in batch_ids if own not in web_assignments]), Job.suspect.is_(None)
    )
    states: dict[str | None, dict[JobState, int]] = {row.id: {} for row in rows}
    for batch_id, state, count in session.execute(job_counts.group_by(Job.batch_id, Job.state)):
        states[batch_id][state] = count
    if web_assignments:
        member = aliased(SubmissionRow)
        attempts = (
            select(member.batch_id, Job.state, func.count(SubmissionRow.id.distinct()))
            .join(Job, Job.submission_id == SubmissionRow.id)
            .join(
                member,
                and_(
                    member.enrolment_id == SubmissionRow.enrolment_id,
                    member.assignment == SubmissionRow.assignment,
                    member.batch_id.in_(list(web_assignments)),
                ),
            )
            .where(
                Job.submission_id.in_(select_shown_submissions(list(web_assignments))), Job.standing == Standing.STANDS
            )
        )
        for batch_id, state, count in session.execute(attempts.group_by(member.batch_id, Job.state)):
            states[batch_id][state] = count
    return [
        BatchLine(
            row.id,
            row.name,
            row.state,
            row.created_at,
            decode(tuple[RejectedSubmission, ...], row.refusals),
            sum(states[row.id].values()),
            states[row.id],
            row.regrade_of,
            web_assignments[row.id].assignment if row.id in web_assignments else None,
            row.id in web_assignments and web_assignments[row.id].closed_at is None,
        )
        for row in rows
    ]


def _find_by_prefix(
    session: Session, column: InstrumentedAttribute[str], newest_column: Any, prefix: str, subject: str
) -> str:
    matches = session.scalars(select(column).where(column.startswith(prefix, autoescape=True)).limit(2)).all()
    if not matches:
        newest_ids = session.scalars(select(column).order_by(newest_column.desc()).limit(_MAX_COMPARED))
        raise UsageError(f"there is no {subject} {prefix!r}{suggest_name(prefix, newest_ids)}")
    if len(matches) > 1:
        raise UsageError(f"more than one {subject} begins with {prefix!r}; give more of its id")
    return matches[0]
