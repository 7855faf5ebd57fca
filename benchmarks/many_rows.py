"""A database as after years of use: 100,000 grades, which are copies of one graded job.

2000 students made two attempts at each of 25 assignments, each in a batch.
The database generates the rows itself, which takes seconds. ``rows.py`` runs the queries.
"""

from __future__ import annotations

from collections.abc import Mapping
from datetime import UTC, datetime, timedelta
from typing import Any

from sqlalchemy import ColumnElement, FromClause, Integer, String, cast, insert, literal, select, update
from sqlalchemy.orm import Session

from benchmarks.graded_store import GradedBatch
from service.store.columns import UtcDateTime
from service.store.engine import Store
from service.store.states import JobState
from service.store.tables.base import Base
from service.store.tables.courses import AssignmentVersion
from service.store.tables.grades import CriterionResultRow, TrialRow
from service.store.tables.people import Enrolment, Person
from service.store.tables.submissions import Batch, Job, SubmissionRow

STUDENTS = 2000
BATCHES = 50
ATTEMPTS = 2
GRADES = STUDENTS * BATCHES
#: Batches that no worker has started to grade.
WAITING_BATCHES = 5
#: Jobs started within the last minute, in the batches before those.
RECENT = 300
#: First row number, above the existing ones.
_FIRST = 1000
#: Added to the number in a name, so that no name is a prefix of another.
_WIDE = 1_000_000
Changes = Mapping[str, ColumnElement[Any]]


def format_batch_name(number: int) -> str:
    return f"b{_WIDE + number}"


def compute_enrolment_id(student: int) -> int:
    return _FIRST + student


def format_grade_name(number: int) -> str:
    return f"j{_WIDE + number}"


def fill(store: Store, image_of: GradedBatch) -> None:
    """Create the rows. All but the last batches are graded."""
    with store.transaction() as session:
        if session.get_bind().dialect.name == "sqlite":
            session.connection().exec_driver_sql("PRAGMA defer_foreign_keys = ON")
        student, number = _select_numbers(STUDENTS), _select_numbers(GRADES)
        job = session.get_one(Job, image_of.job)
        enrolment = session.get_one(Enrolment, job.enrolment_id)
        person_id = _FIRST + student.c.number
        student_name = _build_text("student", student.c.number)
        _copy(session, Person, enrolment.person_id, student, {"id": person_id})
        enrolment_changes = {
            "id": person_id,
            "person_id": person_id,
            "student": student_name,
            "written": student_name,
            "name": student_name,
        }
        _copy(session, Enrolment, enrolment.id, student, enrolment_changes)
        batches = _select_numbers(BATCHES)
        _copy(session, Batch, image_of.batch, batches, {"id": _build_text("b", _WIDE + batches.c.number)})
        versions = _select_numbers(BATCHES // ATTEMPTS)
        version_changes = {
            "id": _FIRST + versions.c.number,
            "assignment": _build_text("a", _WIDE + versions.c.number),
            "sha256": _build_text("v", versions.c.number),
        }
        _copy(session, AssignmentVersion, job.assignment_version_id, versions, version_changes)
        grade_number = number.c.number
        batch_number = _divide(grade_number, STUDENTS)
        assignment_number = _divide(batch_number, ATTEMPTS)
        parent_keys = {
            "enrolment_id": _FIRST + grade_number % STUDENTS,
            "batch_id": _build_text("b", _WIDE + batch_number),
        }
        submission_changes = {
            "id": _FIRST + grade_number,
            "assignment": _build_text("a", _WIDE + assignment_number),
            "attempt": batch_number % ATTEMPTS + 1,
            "sha256": _build_text("s", grade_number),
        }
        _copy(session, SubmissionRow, job.submission_id, number, parent_keys | submission_changes)
        long_ago = literal(datetime.now(UTC) - timedelta(days=2), UtcDateTime())
        job_changes = {
            "id": _build_text("j", _WIDE + grade_number),
            "submission_id": _FIRST + grade_number,
            "assignment_version_id": _FIRST + assignment_number,
            "cache_key": _build_text("c", grade_number),
        }
        moments = dict.fromkeys(("queued_at", "due_at", "started_at", "graded_at", "finished_at"), long_ago)
        _copy(session, Job, image_of.job, number, parent_keys | job_changes | moments)
        _copy_job_rows(session, TrialRow, image_of.job, number)
        _copy_job_rows(session, CriterionResultRow, image_of.job, number)
        _requeue_last_batches(session)


def cancel_waiting_jobs(store: Store, remaining: int) -> None:
    """Cancel waiting jobs until this number remains, equally in each waiting batch."""
    first = range((BATCHES - WAITING_BATCHES) * STUDENTS, GRADES, STUDENTS)
    # The first jobs of a batch were claimed.
    last = [start + STUDENTS - 1 - place for start in first for place in range(remaining // WAITING_BATCHES)]
    kept_ids = [format_grade_name(number) for number in last]
    with store.transaction() as session:
        is_cancelled = (Job.state == JobState.QUEUED, Job.id.not_in(kept_ids))
        session.execute(update(Job).where(*is_cancelled).values(state=JobState.CANCELLED))


def _requeue_last_batches(session: Session) -> None:
    batch_ids = [format_batch_name(number) for number in range(BATCHES - WAITING_BATCHES, BATCHES)]
    graded_columns = ("verdict", "marks", "max_marks", "cache_key", "started_at", "graded_at", "finished_at", "worker")
    cleared_values = dict.fromkeys(graded_columns) | {
        "attempt": 0,
        "progress": 0.0,
        "plots": "none",
        "plots_due_at": None,
    }
    session.execute(update(Job).where(Job.batch_id.in_(batch_ids)).values(state=JobState.QUEUED, **cleared_values))
    recent_ids = [format_grade_name(number) for number in range(RECENT)]
    session.execute(update(Job).where(Job.id.in_(recent_ids)).values(started_at=datetime.now(UTC)))


def _select_numbers(count: int) -> Any:
    """Return the numbers below ``count`` as a table."""
    first = select(literal(0).label("number")).cte(f"below_{count}", recursive=True)
    return first.union_all(select(first.c.number + 1).where(first.c.number < count - 1))


def _copy(session: Session, kind: type[Base], image_of: Any, numbers: FromClause, changes: Changes) -> None:
    """Insert a copy of one row for each number, with the columns that depend on the number."""
    table = kind.__table__
    selected_columns = [changes.get(column.name, column).label(column.name) for column in table.columns]
    rows = select(*selected_columns).select_from(numbers.join(table, table.c.id == image_of))
    session.execute(insert(kind).from_select([column.name for column in table.columns], rows, include_defaults=False))


def _copy_job_rows(session: Session, kind: type[Base], image_of: str, numbers: FromClause) -> None:
    """Insert copies of all rows of one job for each number."""
    table = kind.__table__
    job_number = numbers.c.number
    changes = {"id": _FIRST + job_number * 100 + table.c.position, "job_id": _build_text("j", _WIDE + job_number)}
    selected_columns = [changes.get(column.name, column).label(column.name) for column in table.columns]
    rows = select(*selected_columns).select_from(numbers.join(table, table.c.job_id == image_of))
    session.execute(insert(kind).from_select([column.name for column in table.columns], rows, include_defaults=False))


def _build_text(prefix: str, number: ColumnElement[Any]) -> ColumnElement[str]:
    return literal(prefix, String()) + cast(number, String)


def _divide(number: ColumnElement[Any], divisor: int) -> ColumnElement[int]:
    return cast((number - number % divisor) / divisor, Integer)
