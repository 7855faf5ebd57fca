"""Queries for a student's own work: open assignments, submissions, and visible marks.

``reports.view`` decides which marks are visible; the pages render them.
"""

from __future__ import annotations

import math
from collections.abc import Collection
from dataclasses import dataclass, replace
from datetime import datetime, timedelta
from decimal import Decimal

from sqlalchemy import ColumnElement, Select, and_, case, func, literal, or_, select, tuple_
from sqlalchemy.orm import Session, aliased

from service.grading.grade import Grade
from service.operations.own_changes import MarksChange, load_changes
from service.reports.view import build_student_view
from service.store.codec import decode
from service.store.courses import open_assignments, policies
from service.store.courses.policies import ExceededLimit, OverLimit, PolicyLimits
from service.store.engine import now
from service.store.grades import appeals, current_grades, results
from service.store.grades.appeals import AppealLine
from service.store.states import UNFINISHED, BatchState, CancelReason, JobState, PlotState, Standing
from service.store.tables.courses import AssignmentVersion
from service.store.tables.submissions import Batch, Job, SubmissionRow

#: Per student and assignment; only the newest submissions are shown.
MAX_LISTED_SUBMISSIONS = 50


@dataclass(frozen=True, slots=True)
class OwnSubmission:
    """A submission of a student, with the marks visible to them; None without visible marks."""

    id: int
    job_id: str
    assignment: str
    title: str
    attempt: int
    source: str
    submitted_at: datetime
    days_late: int
    staff_only: str  # the limit that it exceeds, as a sentence for staff
    over: OverLimit | None
    same_as: int | None  # the student's first attempt with the same files, which counts as the same attempt
    state: JobState
    held_back: bool  # its batch is paused or cancelled
    suspect: bool
    superseded: bool
    published: bool  # the whole grade is released
    plots: PlotState
    shown: bool  # its student may see its grade
    withheld: bool  # its student will see its grade when it is released
    counts: bool  # its marks count for its assignment, and its student may know it
    best_counts: bool  # the best attempt counts in its course, instead of the latest
    released: frozenset[str] = frozenset()  # the visibilities that its student sees
    marks: Decimal | None = None
    max_marks: Decimal | None = None
    change: MarksChange | None = None  # the last change of published marks

    @property
    def waits(self) -> bool:
        """Return whether the job is still queued or running."""
        return self.state in UNFINISHED


@dataclass(frozen=True, slots=True)
class Allowance:
    """A student's remaining attempts and time for an assignment."""

    limits: PolicyLimits
    attempts_made: int
    left: timedelta | None  # until the student's due date; negative after it, None without one
    late_left: timedelta | None  # until late submissions stop counting

    @property
    def attempts_left(self) -> int | None:
        """Number of remaining attempts; None without a limit."""
        return None if self.limits.attempts is None else max(0, self.limits.attempts - self.attempts_made)

    @property
    def days_left(self) -> int:
        """Days until the due date, rounded up."""
        return 0 if self.left is None else max(0, math.ceil(self.left / timedelta(days=1)))

    @property
    def hours_left(self) -> int | None:
        """Whole hours until the due date; None without one, or after it."""
        return None if self.left is None or self.left < timedelta(0) else self.left // timedelta(hours=1)

    @property
    def date_over(self) -> bool:
        """Return whether a submission would be too late to count."""
        return self.late_left is not None and self.late_left < timedelta(0)

    @property
    def used_up(self) -> bool:
        """Return whether no new submission can count."""
        return self.attempts_left == 0 or self.date_over

    def hours_late(self, submission: OwnSubmission) -> int | None:
        """Return the whole hours that a submission is late.

        None if it is on time or a day or more late, or if its due date has moved since.
        """
        if submission.days_late != 1 or self.limits.due_at is None or submission.submitted_at <= self.limits.due_at:
            return None
        delay = submission.submitted_at - self.limits.due_at
        return delay // timedelta(hours=1) if delay < timedelta(days=1) else None


@dataclass(frozen=True, slots=True)
class OwnAssignment:
    """An assignment, as its student sees it in a list."""

    assignment: str
    title: str
    open: bool
    closed_at: datetime | None  # None if it is open, or was never opened
    allowance: Allowance
    newest: OwnSubmission | None
    counting: OwnSubmission | None  # the one whose marks count
    appeal: AppealLine | None  # the newest


@dataclass(frozen=True, slots=True)
class OwnAttempts:
    """A student's submissions to an assignment, newest first, and the one whose marks count."""

    newest: list[OwnSubmission]
    counting: OwnSubmission | None


def load_own_assignments(session: Session, course_id: int, enrolment_id: int) -> list[OwnAssignment]:
    """Return the opened assignments and those that a student submitted to: open ones first, by due date."""
    submissions = _load_submissions(
        session,
        _select_submissions(session, enrolment_id).where(or_(_is_counting(enrolment_id), _is_newest(enrolment_id))),
    )
    newest_submissions = {each.assignment: each for each in sorted(submissions, key=lambda each: each.attempt)}
    counting_submissions = {each.assignment: each for each in submissions if each.counts}
    newest_appeals = appeals.load_newest_appeals(session, enrolment_id)
    course_assignments = open_assignments.list_assignments(session, course_id)
    opened_assignments = {each.assignment: each for each in course_assignments if each.opened_at is not None}
    titles = {name: each.title for name, each in newest_submissions.items()}
    titles |= {name: each.title for name, each in opened_assignments.items() if each.open or name not in titles}
    allowances = compute_allowances(session, enrolment_id, titles)
    lines = [
        OwnAssignment(
            name,
            title,
            name in opened_assignments and opened_assignments[name].open,
            opened_assignments[name].closed_at if name in opened_assignments else None,
            allowances[name],
            newest_submissions.get(name),
            counting_submissions.get(name),
            newest_appeals.get(name),
        )
        for name, title in titles.items()
    ]
    return sorted(lines, key=_compute_urgency)


def load_own_attempts(session: Session, enrolment_id: int, assignment: str) -> OwnAttempts:
    """Return a student's submissions to an assignment."""
    # The column's type makes any text storable; a bare literal would not.
    return _build_attempts(
        _load_submissions(
            session, _select_attempts(session, enrolment_id, literal(assignment, SubmissionRow.assignment.type))
        )
    )


def find_newest_row(session: Session, enrolment_id: int, assignment: str) -> SubmissionRow | None:
    """Return a student's newest submission to an assignment, with its files; None if there is none."""
    is_own = (SubmissionRow.enrolment_id == enrolment_id, SubmissionRow.assignment == assignment)
    return session.scalar(select(SubmissionRow).where(*is_own).order_by(SubmissionRow.attempt.desc()).limit(1))


def find_submission_with_attempts(
    session: Session, enrolment_id: int, submission_id: int
) -> tuple[OwnSubmission, OwnAttempts] | None:
    """Return a student's submission and all their submissions to its assignment; None if they do not have it."""
    row = aliased(SubmissionRow)
    conditions = (row.id == submission_id, row.enrolment_id == enrolment_id)
    assignment = select(row.assignment).where(*conditions).scalar_subquery()
    submissions = _load_submissions(
        session, _select_attempts(session, enrolment_id, assignment, SubmissionRow.id == submission_id)
    )
    submission = next((each for each in submissions if each.id == submission_id), None)
    return None if submission is None else (submission, _build_attempts(submissions))


def load_submissions_before(
    session: Session, enrolment_id: int, submission_id: int | None, limit: int
) -> list[OwnSubmission]:
    """Return at most ``limit`` submissions of a student to all assignments, newest first, before this one."""
    query = _select_submissions(session, enrolment_id)
    if submission_id is not None:
        query = query.where(SubmissionRow.id < submission_id)
    return _load_submissions(session, query.order_by(SubmissionRow.id.desc()).limit(limit))


def find_own_submission(session: Session, enrolment_id: int, submission_id: int) -> OwnSubmission | None:
    """Return a student's submission; None if they do not have it."""
    query = _select_submissions(session, enrolment_id).where(SubmissionRow.id == submission_id)
    return next(iter(_load_submissions(session, query)), None)


def compute_allowance(session: Session, enrolment_id: int, assignment: str) -> Allowance:
    """Return the remaining attempts and time of a student, including extensions."""
    return compute_allowances(session, enrolment_id, [assignment])[assignment]


def compute_allowances(session: Session, enrolment_id: int, assignments: Collection[str]) -> dict[str, Allowance]:
    """Return ``allowance`` for several assignments, with the same number of statements."""
    limits, current_time = policies.load_limits_by_assignment(session, enrolment_id, assignments), now(session)
    attempt_counts = policies.count_attempts(session, enrolment_id, assignments)
    return {
        each: Allowance(
            limits[each],
            attempt_counts[each],
            None if (due_at := limits[each].due_at) is None else due_at - current_time,
            None if (closed_at := limits[each].closed_at) is None else closed_at - current_time,
        )
        for each in assignments
    }


_SubmissionSelect = Select[SubmissionRow, Job, str, BatchState | None, int | None, bool, bool, bool, bool, str | None]


def _select_attempts(
    session: Session, enrolment_id: int, assignment: ColumnElement[str], *also: ColumnElement[bool]
) -> _SubmissionSelect:
    """Return a query for the newest submissions to an assignment, the one that counts, and those matching ``also``."""
    row = aliased(SubmissionRow)
    newest_ids = select(row.id).where(row.enrolment_id == enrolment_id, row.assignment == assignment)
    is_included = or_(
        SubmissionRow.id.in_(newest_ids.order_by(row.attempt.desc()).limit(MAX_LISTED_SUBMISSIONS)),
        _is_counting(enrolment_id),
        *also,
    )
    query = _select_submissions(session, enrolment_id).where(SubmissionRow.assignment == assignment, is_included)
    return query.order_by(SubmissionRow.attempt.desc())


def _build_attempts(submissions: list[OwnSubmission]) -> OwnAttempts:
    return OwnAttempts(submissions[:MAX_LISTED_SUBMISSIONS], next((each for each in submissions if each.counts), None))


def _is_counting(enrolment_id: int) -> ColumnElement[bool]:
    """Return the condition that the marks of a student's ``SubmissionRow`` count."""
    return SubmissionRow.id.in_(current_grades.select_counted_submissions(SubmissionRow.enrolment_id == enrolment_id))


def _is_newest(enrolment_id: int) -> ColumnElement[bool]:
    """Return the condition that a student's ``SubmissionRow`` is the newest to its assignment."""
    row = aliased(SubmissionRow)
    newest_attempt = (
        select(row.assignment, func.max(row.attempt))
        .join(Job, Job.submission_id == row.id)
        .where(row.enrolment_id == enrolment_id, Job.standing == Standing.STANDS)
        .group_by(row.assignment)
    )
    return tuple_(SubmissionRow.assignment, SubmissionRow.attempt).in_(newest_attempt)


def _select_submissions(session: Session, enrolment_id: int) -> _SubmissionSelect:
    earlier_submission = aliased(SubmissionRow)
    same_attempt = (
        select(func.min(earlier_submission.attempt))
        .where(
            earlier_submission.enrolment_id == SubmissionRow.enrolment_id,
            earlier_submission.assignment == SubmissionRow.assignment,
            earlier_submission.sha256 == SubmissionRow.sha256,
            earlier_submission.attempt < SubmissionRow.attempt,
        )
        .scalar_subquery()
    )
    current_time = now(session)
    is_released = policies.match_released(current_time)
    is_best, select_unpublished = policies.match_best_counts(), current_grades.select_unpublished_job
    is_decided = and_(
        select_unpublished("hidden", "after_published").is_(None),
        current_grades.select_unreleased_job(current_time).is_(None),
    )
    return (
        select(
            SubmissionRow,
            Job,
            AssignmentVersion.title,
            Batch.state,
            same_attempt,
            and_(*current_grades.CAN_COUNT, is_released),
            and_(*current_grades.CAN_COUNT, ~is_released),
            and_(_is_counting(enrolment_id), or_(~is_best, is_decided)),
            is_best,
            case((is_best, select_unpublished("after_due_date"))),
        )
        .join(Job, Job.submission_id == SubmissionRow.id)
        .join(AssignmentVersion, Job.assignment_version_id == AssignmentVersion.id)
        .outerjoin(Batch, Job.batch_id == Batch.id)
        .where(SubmissionRow.enrolment_id == enrolment_id, Job.standing == Standing.STANDS)
    )


def _load_submissions(session: Session, query: _SubmissionSelect) -> list[OwnSubmission]:
    """Return the submissions with their visible marks.

    The best attempt is the one that counts only if its student sees all marks that decide this: hidden marks could
    otherwise be found by comparing attempts.
    """
    rows = session.execute(query).all()
    submissions = [_build_submission(*row[:9]) for row in rows]
    visible_job_ids = [each.job_id for each in submissions if each.shown]
    due_job_ids = {row[9] for row in rows if row[9] is not None}
    grades_by_job, visibilities_by_job = (
        results.load_marks(session, visible_job_ids),
        policies.load_visibilities_by_job(session, {*visible_job_ids, *due_job_ids}),
    )
    undecided = {
        submission.id
        for submission, row in zip(submissions, rows, strict=True)
        if row[9] is not None and "after_due_date" not in visibilities_by_job[row[9]]
    }
    submissions = [replace(each, counts=False) if each.id in undecided else each for each in submissions]
    published_ids = [each.id for each in submissions if each.shown and each.published]
    changes = load_changes(session, published_ids) if published_ids else {}
    return [
        _add_marks(each, grades_by_job[each.job_id], visibilities_by_job[each.job_id], changes.get(each.id))
        if each.job_id in grades_by_job
        else each
        for each in submissions
    ]


def _add_marks(
    submission: OwnSubmission, grade: Grade, visibilities: frozenset[str], change: MarksChange | None
) -> OwnSubmission:
    visible_grade = build_student_view(grade, visibilities).grade
    marks, max_marks = visible_grade.marks, visible_grade.max_marks
    if change is not None and (change.marks, change.max_marks) == (marks, max_marks):
        change = None
    return replace(submission, marks=marks, max_marks=max_marks, released=visibilities, change=change)


def _build_submission(
    row: SubmissionRow,
    job: Job,
    title: str,
    batch: BatchState | None,
    same_as: int | None,
    is_shown: bool,
    is_withheld: bool,
    counts: bool,
    best_counts: bool,
) -> OwnSubmission:
    return OwnSubmission(
        id=row.id,
        job_id=job.id,
        assignment=row.assignment,
        title=title,
        attempt=row.attempt,
        source=row.source,
        submitted_at=row.submitted_at or row.created_at,
        days_late=row.days_late,
        staff_only=row.staff_only or "",
        over=None if row.exceeded is None else decode(ExceededLimit, row.exceeded).limit,
        same_as=same_as,
        state=job.state,
        held_back=batch not in (None, BatchState.OPEN),
        suspect=job.suspect is not None,
        superseded=job.cancelled_for is CancelReason.SUPERSEDED,
        published=job.published_at is not None,
        plots=job.plots,
        shown=is_shown,
        withheld=is_withheld,
        counts=counts,
        best_counts=best_counts,
    )


def _compute_urgency(line: OwnAssignment) -> tuple[bool, bool, float, str]:
    due_at = line.allowance.limits.due_at
    return not line.open, line.allowance.date_over, math.inf if due_at is None else due_at.timestamp(), line.title
