"""Rows of jobs for tables and exports: state, marks and failures. Read-only.

A batch has a row for each student who submitted in it. The row shows the student's current attempt, which may be in
another batch (``service.store.grades.current_grades``).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from datetime import datetime
from decimal import Decimal

from sqlalchemy import ColumnElement, Row, Select, case, func, select, tuple_
from sqlalchemy.orm import Session, defer

from service.store.batches.batches import is_regrade, select_shown_submissions
from service.store.courses.hidden_names import NO_HIDDEN_NAMES, HiddenNames
from service.store.grades import current_grades, overrides
from service.store.states import UNFINISHED, CancelReason, JobState, PlotState, Role, Standing
from service.store.tables.courses import AssignmentVersion
from service.store.tables.grades import CriterionResultRow, Override, TrialRow
from service.store.tables.people import Enrolment
from service.store.tables.submissions import Job, SubmissionRow
from sim.errors import UsageError

#: Columns read for each job.
_JobColumns = tuple[
    Job, str, str, str, str, AssignmentVersion, int, float | None, str | None, int, int | None, int | None,
    int | None, str | None, int | None,
]  # fmt: skip


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
    provisional: bool  # the marks depend on a pool of which not all trials were run
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


def match_standing_jobs(session: Session, batch_id: str) -> tuple[ColumnElement[bool], ...]:
    """Return the conditions that select the standing jobs of a batch; for a batch of regrades, its own jobs."""
    if is_regrade(session, batch_id):
        return (Job.batch_id == batch_id, Job.suspect.is_(None))
    return (Job.submission_id.in_(select_shown_submissions([batch_id])), Job.standing == Standing.STANDS)


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
        .options(*(defer(column, raiseload=True) for column in (Job.notes, Job.hints, Job.cost, Job.phases)))
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
        provisional=job.provisional,
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
