"""Table of a batch: a short row for each submission and rejection, filtered, sorted and split into pages.

Read-only. Reads only the columns that a row shows; ``job_lines.py`` reads everything about one job.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from datetime import datetime, timedelta
from decimal import Decimal
from types import MappingProxyType
from typing import Any

from sqlalchemy import func, select
from sqlalchemy.orm import Session

from service.page_rows import select_page
from service.search_text import fold_text
from service.store.batches.job_lines import match_standing_jobs
from service.store.courses.hidden_names import HiddenNames
from service.store.grades import current_grades, overrides
from service.store.states import CancelReason, JobState
from service.store.tables.courses import AssignmentVersion
from service.store.tables.grades import CriterionResultRow, TrialRow
from service.store.tables.people import Enrolment
from service.store.tables.submissions import Batch, Job, SubmissionRow
from submissions.student_identity import RejectedSubmission

REFUSED = "refused"
ROWS_A_PAGE = 100
#: Values of the state filter.
STATES = (*(state.value for state in JobState), REFUSED)


@dataclass(frozen=True, slots=True)
class TableLine:
    """A row of the table. A rejected file has no job: its ``id`` is empty and ``error`` contains the reason."""

    id: str
    submission_id: int
    student: str
    name: str
    source: str
    assignment: str
    state: str
    verdict: str | None
    marks: Decimal | None
    max_marks: Decimal
    error: str
    cancelled_for: CancelReason | None
    superseded_by: str | None  # the newer submission's job, if known
    suspect: str | None
    staff_only: str | None
    days_late: int
    attempt: int
    sha256: str
    seconds: float | None  # from start to marks, if it was run
    published_at: datetime | None
    elsewhere: bool  # submitted in a batch other than the table's
    newer_attempt: int | None  # the newest later attempt that is not graded or over a limit
    provisional: bool = False  # the marks depend on a pool of which not all trials were run

    @property
    def share(self) -> Decimal:
        """Marks as a fraction of the maximum; -1 without marks, so that the row sorts last."""
        return Decimal(-1) if self.marks is None or not self.max_marks else self.marks / self.max_marks


@dataclass(frozen=True, slots=True)
class TableRequest:
    """Filter, sort order and page of a table. An empty ``state`` selects all states."""

    state: str = ""
    text: str = ""
    sort: str = "student"
    descending: bool = False
    page: int = 1


@dataclass(frozen=True, slots=True)
class TablePage:
    """A page of the matching rows, with the number of rows and pages."""

    lines: tuple[TableLine, ...]
    found: int
    page: int
    pages: int


@dataclass(frozen=True, slots=True)
class ReviewCounts:
    """Additional review counts of a job: unjudged criteria, and trials in which Robomark's own code failed."""

    unjudged: int = 0
    surprises: int = 0


def _build_student_key(line: TableLine) -> tuple[Any, ...]:
    return (fold_text(line.student), line.assignment, line.id)


#: Sort keys, by the name of the order.
SORTS: Mapping[str, Callable[[TableLine], Any]] = MappingProxyType(
    {
        "student": _build_student_key,
        "name": lambda line: fold_text(line.name),
        "assignment": lambda line: line.assignment,
        "marks": lambda line: line.share,
        "state": lambda line: (STATES.index(line.state), line.verdict or ""),
        "seconds": lambda line: -1.0 if line.seconds is None else line.seconds,
    }
)


def load_table_lines(
    session: Session, batch_id: str, refusals: Sequence[RejectedSubmission], hidden_names: HiddenNames
) -> list[TableLine]:
    """Return all rows of a batch, ordered by student."""
    row = session.get(Batch, batch_id)  # kept, so that it is read once
    query = (
        select(
            Job.id,
            Job.submission_id,
            Enrolment.student,
            Enrolment.name,
            SubmissionRow.source,
            SubmissionRow.assignment,
            Job.state,
            Job.verdict,
            Job.marks,
            func.coalesce(Job.max_marks, AssignmentVersion.max_marks),
            Job.error,
            Job.cancelled_for,
            Job.superseded_by,
            Job.suspect,
            SubmissionRow.staff_only,
            SubmissionRow.days_late,
            SubmissionRow.attempt,
            SubmissionRow.sha256,
            Job.started_at,
            Job.graded_at,
            Job.published_at,
            SubmissionRow.batch_id,
            current_grades.select_newer_attempt(),
            Job.provisional,
        )
        .join(SubmissionRow, Job.submission_id == SubmissionRow.id)
        .join(Enrolment, Job.enrolment_id == Enrolment.id)
        .join(AssignmentVersion, Job.assignment_version_id == AssignmentVersion.id)
        .where(*match_standing_jobs(session, batch_id))
    )
    own_batch = None if row is None or row.regrade_of is not None else batch_id
    lines = [_build_line(tuple(found), own_batch, hidden_names) for found in session.execute(query)]
    lines += [_build_rejected_line(refusal) for refusal in refusals]
    return sorted(lines, key=_build_student_key)


def build_table_page(lines: Sequence[TableLine], request: TableRequest) -> TablePage:
    """Return the requested page of the matching rows, or the last page if there are fewer."""
    text = fold_text(request.text.strip())
    matching_lines = [
        line
        for line in lines
        if (not request.state or line.state == request.state) and text in _build_search_text(line)
    ]
    matching_lines.sort(key=SORTS.get(request.sort, _build_student_key), reverse=request.descending)
    shown = select_page(matching_lines, request.page, ROWS_A_PAGE)
    return TablePage(shown.rows, len(matching_lines), shown.page, shown.pages)


def load_review_counts(session: Session, lines: Sequence[TableLine]) -> dict[str, ReviewCounts]:
    """Return the review counts of some jobs, by job id."""
    job_ids = [line.id for line in lines if line.id]
    unjudged_counts = dict(
        session.execute(
            select(CriterionResultRow.job_id, func.count())
            .join(Job, CriterionResultRow.job_id == Job.id)
            .where(CriterionResultRow.job_id.in_(job_ids), overrides.match_unjudged())
            .group_by(CriterionResultRow.job_id)
        ).all()
    )
    surprises = dict(
        session.execute(
            select(TrialRow.job_id, func.count())
            .where(TrialRow.job_id.in_(job_ids), TrialRow.surprise.is_not(None))
            .group_by(TrialRow.job_id)
        ).all()
    )
    return {
        job_id: ReviewCounts(unjudged_counts.get(job_id, 0), surprises.get(job_id, 0))
        for job_id in {*unjudged_counts, *surprises}
    }


def _build_line(row: tuple[Any, ...], own_batch: str | None, hidden_names: HiddenNames) -> TableLine:
    job_id, submission_id, student, name, source, assignment, state, verdict, marks, max_marks, *remaining = row
    error, cancelled_for, superseded_by, *remaining = remaining
    suspect, staff_only, days_late, attempt, sha256, started_at, graded_at, published_at, *remaining = remaining
    batch_id, newer_attempt, is_provisional = remaining
    has_hidden_name = assignment in hidden_names.assignments
    duration: timedelta | None = None if started_at is None or graded_at is None else graded_at - started_at
    return TableLine(
        id=job_id,
        submission_id=submission_id,
        student=hidden_names.label_student(assignment, student),
        name="" if has_hidden_name else name,
        source="" if has_hidden_name else source,
        assignment=assignment,
        state=state.value,
        verdict=verdict,
        marks=marks,
        max_marks=max_marks,
        error=error or "",
        cancelled_for=cancelled_for,
        superseded_by=superseded_by,
        suspect=suspect,
        staff_only=staff_only,
        days_late=days_late,
        attempt=attempt,
        sha256=sha256,
        seconds=None if duration is None else duration.total_seconds(),
        published_at=published_at,
        elsewhere=own_batch is not None and batch_id != own_batch,
        newer_attempt=newer_attempt,
        provisional=is_provisional,
    )


def _build_rejected_line(refusal: RejectedSubmission) -> TableLine:
    return TableLine(
        id="",
        submission_id=0,
        student=refusal.student.id or refusal.source,
        name=refusal.student.name,
        source=refusal.source,
        assignment=refusal.assignment,
        state=REFUSED,
        verdict=None,
        marks=None,
        max_marks=Decimal(0),
        error=refusal.reason,
        cancelled_for=None,
        superseded_by=None,
        suspect=None,
        staff_only=None,
        days_late=0,
        attempt=0,
        sha256="",
        seconds=None,
        published_at=None,
        elsewhere=False,
        newer_attempt=None,
    )


def _build_search_text(line: TableLine) -> str:
    return fold_text(" ".join((line.student, line.name, line.source, line.assignment, line.verdict or "")))
