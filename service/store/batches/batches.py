"""Queries about batches and jobs for instructors: progress, marks and failures. Read-only.

A batch has a row for each student who submitted in it. The row shows the student's current attempt, which may be in
another batch (``service.store.grades.current_grades``).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from datetime import datetime
from decimal import Decimal
from typing import Any

from sqlalchemy import ColumnElement, Row, Select, and_, case, func, or_, select, tuple_
from sqlalchemy.orm import InstrumentedAttribute, Session, aliased

from service.store.codec import decode
from service.store.courses.hidden_names import NO_HIDDEN_NAMES, HiddenNames
from service.store.grades import current_grades, overrides
from service.store.models import (
    AssignmentVersion,
    Batch,
    CriterionResultRow,
    Enrolment,
    Job,
    SubmissionRow,
    TrialRow,
)
from service.store.states import UNFINISHED, BatchState, CancelReason, JobState, PlotState, Role, Standing
from service.store.web_tables import OpenAssignment, Override
from sim.errors import UsageError
from submissions.student_identity import RejectedSubmission
from submissions.suggestions import suggest_name

#: Columns read for each job.
_JobColumns = tuple[
    Job, str, str, str, str, AssignmentVersion, int, float | None, str | None, int, int | None, int | None,
    int | None, str | None, int | None,
]  # fmt: skip
_MAX_LISTED = 50
#: Number of newest ids considered for a "did you mean" hint.
_MAX_COMPARED = 1000


@dataclass(frozen=True, slots=True)
class JobLine:
    """A job, as shown in a table."""

    id: str
    submission_id: int
    student: str
    name: str  # the student's
    email: str
    source: str
    assignment: str
    state: JobState
    verdict: str | None
    marks: Decimal | None
    max_marks: Decimal
    accuracy: float | None  # of the first criterion that classifies and is not excused
    attempt: int  # the student's
    error: str | None
    cancelled_for: CancelReason | None
    superseded_by: str | None  # the newer submission's job, if known
    plots: PlotState
    sandbox: str | None  # the active sandbox layers
    worker: str | None
    queued_at: datetime
    finished_at: datetime | None
    standing: Standing
    missing: str  # the required part that was not submitted
    copied_from: str | None  # the identical grade that was copied
    suspect: str | None  # why the grade is not trusted
    staff_only: str | None  # the limit that the submission exceeds
    unjudged: int  # criteria that could not be judged and were not set by staff
    set_by_hand: int  # criteria set by staff
    surprises: int  # trials in which Robomark's own code failed on data from a child
    days_late: int
    published_at: datetime | None
    batch_id: str | None  # the batch that it was submitted in
    newer_attempt: int | None  # the newest later attempt that is not graded or over a limit

    @property
    def ended(self) -> bool:
        """Return whether the job has reached a final state."""
        return self.state not in UNFINISHED

    def hide_name(self, names: HiddenNames) -> JobLine:
        """Return the line without identifying data if names are hidden for its assignment."""
        if self.assignment not in names.assignments:
            return self
        return replace(self, student=names.label_student(self.assignment, self.student), name="", email="", source="")


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


def match_standing_jobs(session: Session, batch_id: str) -> tuple[ColumnElement[bool], ...]:
    """Return the conditions that select the standing jobs of a batch; for a batch of regrades, its own jobs."""
    if is_regrade(session, batch_id):
        return (Job.batch_id == batch_id, Job.suspect.is_(None))
    return (Job.submission_id.in_(select_shown_submissions([batch_id])), Job.standing == Standing.STANDS)


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


def load_job_lines(session: Session, batch_id: str, hidden_names: HiddenNames = NO_HIDDEN_NAMES) -> list[JobLine]:
    """Return the standing job of each submission of a batch, ordered by displayed student name.

    For a batch of regrades, returns its own jobs.
    """
    query = _select_job_lines().where(*match_standing_jobs(session, batch_id)).order_by(Enrolment.student, Job.id)
    lines = _restore_source_names(session, batch_id, [_build_job_line(row) for row in session.execute(query)])
    return _sort_by_shown_name(lines, hidden_names)


def load_attempt_lines(session: Session, batch_id: str) -> list[JobLine]:
    """Return the standing job of each submission made in a batch, current or not."""
    query = _select_job_lines().where(SubmissionRow.batch_id == batch_id, Job.standing == Standing.STANDS)
    return [_build_job_line(row) for row in session.execute(query.order_by(Enrolment.student, Job.id))]


def load_job_lines_page(
    session: Session, batch_id: str, hidden_names: HiddenNames, limit: int, last_id: str | None = None
) -> list[JobLine]:
    """Return at most ``limit`` job lines of a batch, after the job with this id.

    Hidden names are left out and do not affect the order.
    """
    student = case((SubmissionRow.assignment.in_(hidden_names.assignments), ""), else_=Enrolment.student)
    query = _select_job_lines().where(*match_standing_jobs(session, batch_id)).order_by(student, Job.id).limit(limit)
    if last_id is not None:
        last_student = (
            select(student)
            .select_from(Job)
            .join(SubmissionRow, Job.submission_id == SubmissionRow.id)
            .join(Enrolment, Job.enrolment_id == Enrolment.id)
            .where(Job.id == last_id)
        )
        query = query.where(tuple_(student, Job.id) > tuple_(last_student.correlate(None).scalar_subquery(), last_id))
    lines = _restore_source_names(session, batch_id, [_build_job_line(row) for row in session.execute(query)])
    return [line.hide_name(hidden_names) for line in lines]


def load_course_lines(
    session: Session, course_id: int, assignments: Sequence[str], hidden_names: HiddenNames = NO_HIDDEN_NAMES
) -> list[JobLine]:
    """Return the current job of each student of a course for some assignments, in any batch or in none."""
    students = select(Enrolment.id).where(Enrolment.course_id == course_id, Enrolment.role == Role.STUDENT)
    submission_ids = current_grades.select_shown_submissions(
        SubmissionRow.assignment.in_(assignments), SubmissionRow.enrolment_id.in_(students)
    )
    query = _select_job_lines().where(Job.submission_id.in_(submission_ids), Job.standing == Standing.STANDS)
    return _sort_by_shown_name(
        [_build_job_line(row) for row in session.execute(query.order_by(Enrolment.student, Job.id))], hidden_names
    )


def load_job_line(session: Session, job_id: str) -> JobLine:
    """Return one job. Raises UsageError if the id is unknown."""
    row = session.execute(_select_job_lines().where(Job.id == job_id)).one_or_none()
    if row is None:
        raise UsageError(f"there is no grade {job_id}")
    return _build_job_line(row)


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


def _select_job_lines() -> Select[*_JobColumns]:
    accuracy = (
        select(CriterionResultRow.accuracy)
        .where(
            CriterionResultRow.job_id == Job.id, CriterionResultRow.accuracy.is_not(None), ~overrides.match_excused()
        )
        .order_by(CriterionResultRow.max_marks == 0, CriterionResultRow.position)
        .limit(1)
        .scalar_subquery()
    )
    has_unjudged = (
        select(func.count()).where(CriterionResultRow.job_id == Job.id, overrides.match_unjudged()).scalar_subquery()
    )
    has_override = (
        select(func.count())
        .where(Override.submission_id == Job.submission_id, Override.withdrawn_at.is_(None))
        .scalar_subquery()
    )
    surprises = select(func.count()).where(TrialRow.job_id == Job.id, TrialRow.surprise.is_not(None)).scalar_subquery()
    return (
        select(
            Job,
            Enrolment.student,
            Enrolment.name,
            Enrolment.email,
            SubmissionRow.source,
            AssignmentVersion,
            SubmissionRow.attempt,
            accuracy,
            SubmissionRow.staff_only,
            SubmissionRow.days_late,
            has_unjudged,
            has_override,
            surprises,
            SubmissionRow.batch_id,
            current_grades.select_newer_attempt(),
        )
        .join(SubmissionRow, Job.submission_id == SubmissionRow.id)
        .join(Enrolment, Job.enrolment_id == Enrolment.id)
        .join(AssignmentVersion, Job.assignment_version_id == AssignmentVersion.id)
    )


def _build_job_line(row: Row[*_JobColumns]) -> JobLine:
    job, student, name, email, source, version, attempt, accuracy, staff_only, days_late = row[:10]
    has_unjudged, has_override, surprises, batch_id, newer_attempt = row[10:]
    return JobLine(
        id=job.id,
        submission_id=job.submission_id,
        student=student,
        name=name,
        email=email,
        source=source,
        assignment=version.assignment,
        state=job.state,
        verdict=job.verdict,
        marks=job.marks,
        max_marks=version.max_marks if job.max_marks is None else job.max_marks,
        accuracy=accuracy,
        attempt=attempt,
        error=job.error,
        cancelled_for=job.cancelled_for,
        superseded_by=job.superseded_by,
        plots=job.plots,
        sandbox=job.sandbox,
        worker=job.worker,
        queued_at=job.queued_at,
        finished_at=job.finished_at,
        standing=job.standing,
        missing=job.missing,
        copied_from=job.copied_from,
        suspect=job.suspect,
        staff_only=staff_only,
        unjudged=has_unjudged or 0,
        set_by_hand=has_override or 0,
        surprises=surprises or 0,
        days_late=days_late,
        published_at=job.published_at,
        batch_id=batch_id,
        newer_attempt=newer_attempt,
    )


def _sort_by_shown_name(lines: list[JobLine], names: HiddenNames) -> list[JobLine]:
    """Return the lines as instructors see them, sorted so that neither order nor count reveals hidden names."""
    if not names.assignments:
        return lines
    return sorted((line.hide_name(names) for line in lines), key=lambda line: (line.student, line.id))


def _restore_source_names(session: Session, batch_id: str, lines: list[JobLine]) -> list[JobLine]:
    """Return the lines with the source names that the submissions have in this batch.

    The system that a batch was downloaded from identifies its rows by these names, even after later submissions.
    """
    if all(line.batch_id == batch_id for line in lines):
        return lines
    query = (
        select(Enrolment.student, SubmissionRow.assignment, SubmissionRow.source)
        .join(Enrolment, SubmissionRow.enrolment_id == Enrolment.id)
        .where(SubmissionRow.batch_id == batch_id)
        .order_by(SubmissionRow.attempt)
    )
    sources = {(student, assignment): source for student, assignment, source in session.execute(query)}
    return [replace(line, source=sources.get((line.student, line.assignment), line.source)) for line in lines]
