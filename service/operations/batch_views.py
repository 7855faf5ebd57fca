"""Views of batches: lists, progress, tables, grades, overviews and changes."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from datetime import datetime
from decimal import Decimal
from typing import TYPE_CHECKING

from sqlalchemy.orm import Session

from service.grading.class_statistics import PASS_SHARE, AssignmentStatistics, compute_statistics
from service.grading.ranks import RankTable
from service.operations.context import Actor, Service
from service.operations.lookup import (
    check_operator,
    load_names_for_actor,
    require_any_batch,
    require_batch,
    require_course,
    require_named_course,
)
from service.store import audit
from service.store.audit import AuditEntry as AuditEntry
from service.store.batches import batch_table, batches, job_lines, publishing, rankings, regrade_changes
from service.store.batches.batch_table import REFUSED as REFUSED
from service.store.batches.batch_table import SORTS as SORTS
from service.store.batches.batch_table import STATES as STATES
from service.store.batches.batch_table import ReviewCounts as ReviewCounts
from service.store.batches.batch_table import TableLine as TableLine
from service.store.batches.batch_table import TablePage as TablePage
from service.store.batches.batch_table import TableRequest as TableRequest
from service.store.batches.batches import BatchLine as BatchLine
from service.store.batches.batches import BatchProgress as BatchProgress
from service.store.batches.changes import Change, ChangesSummary, summarise_changes
from service.store.batches.class_overview import ClassOverview as ClassOverview
from service.store.batches.class_overview import compute_overviews, load_missing_students
from service.store.batches.job_lines import JobLine as JobLine
from service.store.batches.regrade_changes import ChangesPage
from service.store.courses import open_assignments
from service.store.courses.hidden_names import HiddenNames
from service.store.courses.open_assignments import CourseAssignment
from service.store.courses.policies import format_days as format_days
from service.store.grades import current_grades
from service.store.grades.statistics_marks import load_marked_submissions
from service.store.queue import metrics, workers
from service.store.queue.metrics import Pace
from service.store.queue.workers import WorkerDescription as WorkerDescription
from service.store.states import BatchState, Role
from service.store.tables.submissions import Batch

if TYPE_CHECKING:
    from service.operations.batches import SubmittedBatch
    from submissions.student_identity import Student

_PAGE_SIZE = 30


@dataclass(frozen=True, slots=True)
class BatchesPage:
    """A page of a course's batches, newest first, with its prepared assignments.

    ``older`` is the id of the last batch if older ones follow.
    """

    batches: tuple[BatchLine, ...]
    older: str
    prepared: tuple[CourseAssignment, ...]


@dataclass(frozen=True, slots=True)
class BatchView:
    """A batch with its progress and pace."""

    batch: BatchLine
    progress: BatchProgress
    pace: Pace | None


@dataclass(frozen=True, slots=True)
class TableView:
    """A batch with all its rows and its activity log, newest first."""

    view: BatchView
    lines: tuple[TableLine, ...]
    has_hidden_names: bool  # names of some students are hidden
    waiting_regrades: int
    history: tuple[AuditEntry, ...]


@dataclass(frozen=True, slots=True)
class GradedView:
    """A batch with the grades of its submissions, and their statistics by assignment."""

    view: BatchView
    lines: tuple[JobLine, ...]
    statistics: tuple[AssignmentStatistics, ...]
    waiting_regrades: int


@dataclass(frozen=True, slots=True)
class StatusView:
    """The complete status of a batch; ``changes`` and their summary are those of a batch of regrades."""

    graded: GradedView
    ranks: tuple[RankTable, ...]
    changes: tuple[Change, ...]
    history: tuple[AuditEntry, ...]
    changes_summary: ChangesSummary | None


@dataclass(frozen=True, slots=True)
class OverviewView:
    """Results of a batch, by assignment.

    If the batch has no graded submissions, ``missing`` contains the students without a submission.
    """

    batch: BatchLine
    lines: tuple[TableLine, ...]
    classes: tuple[ClassOverview, ...]
    missing: tuple[Student, ...]


def list_batches_page(service: Service, actor: Actor, course_id: int, last_id: str = "") -> BatchesPage:
    """Return the newest batches of a course, or those older than the batch ``last_id``. Raises NotFound."""
    with service.store.reading() as session:
        require_course(session, actor, course_id, Role.INSTRUCTOR)
        last_batch = session.get(Batch, last_id) if last_id else None
        cursor = (
            None if last_batch is None or last_batch.course_id != course_id else (last_batch.created_at, last_batch.id)
        )
        batch_lines = batches.list_course_batches(session, course_id, _PAGE_SIZE + 1, cursor)
        course_assignments = open_assignments.list_assignments(session, course_id)
    page_lines = tuple(batch_lines[:_PAGE_SIZE])
    return BatchesPage(
        page_lines, page_lines[-1].id if len(batch_lines) > len(page_lines) else "", tuple(course_assignments)
    )


def list_batches(
    service: Service, actor: Actor, course_id: int, limit: int, cursor: tuple[datetime, str] | None = None
) -> list[BatchLine]:
    """Return the newest batches of a course, after the batch with this time and id. Raises NotFound."""
    with service.store.reading() as session:
        require_course(session, actor, course_id, Role.INSTRUCTOR)
        return batches.list_course_batches(session, course_id, limit, cursor)


def list_newest(service: Service, actor: Actor, course: str | None) -> list[BatchLine]:
    """Return the newest batches of the course with this name, or of all courses; for operators. Raises NotFound."""
    with service.store.reading() as session:
        check_operator(actor)
        return batches.list_batches(
            session, None if course is None else require_named_course(session, actor, course).id
        )


def poll_progress(service: Service, actor: Actor, batch_id: str) -> tuple[BatchProgress, BatchState]:
    """Return the progress and state of a batch of any course, in few queries, for operators. Raises NotFound."""
    check_operator(actor)
    with service.store.reading() as session:
        return batches.load_progress(session, batch_id), require_any_batch(session, batch_id).state


def list_workers(service: Service, actor: Actor) -> list[WorkerDescription]:
    """Return the active workers, for operators. Raises NotFound."""
    check_operator(actor)
    with service.store.reading() as session:
        return [seen.worker for seen in workers.load_workers(session) if seen.lately]


def show_progress(service: Service, actor: Actor, course_id: int, batch_id: str) -> BatchView:
    """Return the progress of a batch. Raises NotFound."""
    with service.store.reading() as session:
        return _load_view(session, actor, course_id, batch_id)


def show_table(service: Service, actor: Actor, course_id: int, batch_id: str) -> TableView:
    """Return a batch with a row for each submission and rejection. Raises NotFound."""
    hidden_names = load_names_for_actor(service, actor, course_id)
    with service.store.reading() as session:
        view = _load_view(session, actor, course_id, batch_id)
        lines = batch_table.load_table_lines(session, batch_id, view.batch.refusals, hidden_names)
        history = audit.load_entries(session, "batch", batch_id)
        waiting_regrades = _count_waiting_regrades(session, view.batch)
    has_hidden_names = bool(hidden_names.assignments & {each.assignment for each in lines})
    return TableView(view, tuple(lines), has_hidden_names, waiting_regrades, tuple(reversed(history)))


def show_table_page(
    service: Service, actor: Actor, course_id: int, lines: Sequence[TableLine], request: TableRequest
) -> tuple[TablePage, dict[str, ReviewCounts]]:
    """Return a page of the rows, and their review counts by job. Raises NotFound."""
    with service.store.reading() as session:
        require_course(session, actor, course_id, Role.INSTRUCTOR)
        table = batch_table.build_table_page(lines, request)
        return table, batch_table.load_review_counts(session, table.lines)


def show_graded(service: Service, actor: Actor, course_id: int, batch_id: str) -> GradedView:
    """Return a batch with its grades and their statistics. Raises NotFound."""
    hidden_names = load_names_for_actor(service, actor, course_id)
    with service.store.reading() as session:
        return _load_graded_view(session, actor, course_id, batch_id, hidden_names)


def show_status(
    service: Service, actor: Actor, course_id: int, batch_id: str, pass_share: Decimal = PASS_SHARE
) -> StatusView:
    """Return the complete status of a batch. Raises NotFound."""
    hidden_names = load_names_for_actor(service, actor, course_id)
    with service.store.reading() as session:
        graded_view = _load_graded_view(session, actor, course_id, batch_id, hidden_names)
        is_regrade = graded_view.view.batch.regrade_of is not None
        changes = regrade_changes.load_changes(session, batch_id, hidden_names, pass_share) if is_regrade else []
        summary = summarise_changes(changes, pass_share) if is_regrade else None
        ranks = rankings.build_rank_tables(session, graded_view.lines)
        history = audit.load_entries(session, "batch", batch_id)
    return StatusView(graded_view, tuple(ranks), tuple(changes), tuple(history), summary)


def list_grades(
    service: Service, actor: Actor, course_id: int, batch_id: str, limit: int, last_id: str | None = None
) -> list[JobLine]:
    """Return at most ``limit`` grades of a batch, after the one with the id ``last_id``. Raises NotFound."""
    hidden_names = load_names_for_actor(service, actor, course_id)
    with service.store.reading() as session:
        require_course(session, actor, course_id, Role.INSTRUCTOR)
        require_batch(session, course_id, batch_id)
        return job_lines.load_job_lines_page(session, batch_id, hidden_names, limit, last_id)


def list_submitted(service: Service, actor: Actor, submitted_batch: SubmittedBatch) -> list[JobLine]:
    """Return the grades of new submissions and of those known before, for operators. Raises NotFound."""
    check_operator(actor)
    with service.store.reading() as session:
        lines = [job_lines.load_job_line(session, known.job_id) for known in submitted_batch.known]
        if submitted_batch.batch is not None:
            lines += job_lines.load_attempt_lines(session, submitted_batch.batch.id)
    return sorted(lines, key=lambda line: (line.student, line.id))


def show_statistics(service: Service, actor: Actor, lines: Iterable[JobLine]) -> tuple[AssignmentStatistics, ...]:
    """Return the statistics of these grades by assignment, for operators. Raises NotFound."""
    check_operator(actor)
    with service.store.reading() as session:
        return _compute_statistics(session, tuple(lines))


def show_overview(
    service: Service, actor: Actor, course_id: int, batch_id: str, pass_share: Decimal = PASS_SHARE
) -> OverviewView:
    """Return the overview of a batch: marks, criteria, causes, missing students and grades to review.

    Raises NotFound.
    """
    hidden_names = load_names_for_actor(service, actor, course_id)
    with service.store.reading() as session:
        require_course(session, actor, course_id, Role.INSTRUCTOR)
        row = require_batch(session, course_id, batch_id)
        line = batches.load_batch(session, row.id)
        lines = tuple(batch_table.load_table_lines(session, row.id, line.refusals, hidden_names))
        return _build_overview(session, course_id, line, lines, pass_share, hidden_names)


def show_overview_of_table(
    service: Service, actor: Actor, course_id: int, table: TableView, pass_share: Decimal = PASS_SHARE
) -> OverviewView:
    """Return the overview of a table that the actor has already loaded. Raises NotFound."""
    hidden_names = load_names_for_actor(service, actor, course_id)
    with service.store.reading() as session:
        require_course(session, actor, course_id, Role.INSTRUCTOR)
        return _build_overview(session, course_id, table.view.batch, table.lines, pass_share, hidden_names)


def show_changes_page(
    service: Service, actor: Actor, course_id: int, batch_id: str, number: int, pass_share: Decimal = PASS_SHARE
) -> ChangesPage:
    """Return a page of the changes of a batch of regrades, different marks first. Raises NotFound."""
    hidden_names = load_names_for_actor(service, actor, course_id)
    with service.store.reading() as session:
        require_course(session, actor, course_id, Role.INSTRUCTOR)
        require_batch(session, course_id, batch_id)
        return regrade_changes.load_changes_page(session, batch_id, number, hidden_names, pass_share)


def is_graded(line: TableLine) -> bool:
    """Return whether the row has a grade that counts."""
    return current_grades.is_for_students(line)


def _build_overview(
    session: Session,
    course_id: int,
    line: BatchLine,
    lines: tuple[TableLine, ...],
    pass_share: Decimal,
    hidden_names: HiddenNames,
) -> OverviewView:
    classes = compute_overviews(session, course_id, lines, pass_share, hidden_names)
    assignment = line.web_assignment if not classes else None
    return OverviewView(
        line, lines, classes, load_missing_students(session, course_id, assignment, hidden_names) if assignment else ()
    )


def _load_view(session: Session, actor: Actor, course_id: int, batch_id: str) -> BatchView:
    require_course(session, actor, course_id, Role.INSTRUCTOR)
    row = require_batch(session, course_id, batch_id)
    line = batches.load_batch(session, row.id)
    return BatchView(line, batches.load_progress(session, batch_id), metrics.estimate_pace(session, batch_id))


def _load_graded_view(
    session: Session, actor: Actor, course_id: int, batch_id: str, hidden_names: HiddenNames
) -> GradedView:
    view = _load_view(session, actor, course_id, batch_id)
    lines = tuple(job_lines.load_job_lines(session, batch_id, hidden_names))
    return GradedView(view, lines, _compute_statistics(session, lines), _count_waiting_regrades(session, view.batch))


def _compute_statistics(session: Session, lines: Sequence[JobLine]) -> tuple[AssignmentStatistics, ...]:
    return compute_statistics(load_marked_submissions(session, lines))


def _count_waiting_regrades(session: Session, line: BatchLine) -> int:
    return 0 if line.regrade_of is not None else publishing.count_unpublished_regrades(session, line.id)
