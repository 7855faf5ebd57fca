"""A database as after years of use: 100,000 grades of 2000 students, all copies of one graded job.

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
from service.store.models import Base, Batch, CriterionResultRow, Enrolment, Job, Person, SubmissionRow, TrialRow
from service.store.states import JobState

STUDENTS = 2000
BATCHES = 50
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
        who = _FIRST + student.c.number
        named = _build_text("student", student.c.number)
        _copy(session, Person, enrolment.person_id, student, {"id": who})
        enrolled = {"id": who, "person_id": who, "student": named, "written": named, "name": named}
        _copy(session, Enrolment, enrolment.id, student, enrolled)
        batches = _select_numbers(BATCHES)
        _copy(session, Batch, image_of.batch, batches, {"id": _build_text("b", _WIDE + batches.c.number)})
        which = number.c.number
        of = {
            "enrolment_id": _FIRST + which % STUDENTS,
            "batch_id": _build_text("b", _WIDE + _divide(which, STUDENTS)),
        }
        submitted = {"id": _FIRST + which, "attempt": _divide(which, STUDENTS) + 1, "sha256": _build_text("s", which)}
        _copy(session, SubmissionRow, job.submission_id, number, of | submitted)
        long_ago = literal(datetime.now(UTC) - timedelta(days=2), UtcDateTime())
        graded = {
            "id": _build_text("j", _WIDE + which),
            "submission_id": _FIRST + which,
            "cache_key": _build_text("c", which),
        }
        moments = dict.fromkeys(("queued_at", "due_at", "started_at", "graded_at", "finished_at"), long_ago)
        _copy(session, Job, image_of.job, number, of | graded | moments)
        _copy_job_rows(session, TrialRow, image_of.job, number)
        _copy_job_rows(session, CriterionResultRow, image_of.job, number)
        _requeue_last_batches(session)


def _requeue_last_batches(session: Session) -> None:
    waiting = [format_batch_name(number) for number in range(BATCHES - WAITING_BATCHES, BATCHES)]
    graded = ("verdict", "marks", "max_marks", "cache_key", "started_at", "graded_at", "finished_at", "worker")
    nothing = dict.fromkeys(graded) | {"attempt": 0, "progress": 0.0, "plots": "none", "plots_due_at": None}
    session.execute(update(Job).where(Job.batch_id.in_(waiting)).values(state=JobState.QUEUED, **nothing))
    recent = [format_grade_name(number) for number in range(RECENT)]
    session.execute(update(Job).where(Job.id.in_(recent)).values(started_at=datetime.now(UTC)))


def _select_numbers(count: int) -> Any:
    """Return the numbers below ``count`` as a table."""
    first = select(literal(0).label("number")).cte(f"below_{count}", recursive=True)
    return first.union_all(select(first.c.number + 1).where(first.c.number < count - 1))


def _copy(session: Session, kind: type[Base], image_of: Any, numbers: FromClause, changes: Changes) -> None:
    """Insert a copy of one row for each number, with the columns that depend on the number."""
    table = kind.__table__
    chosen = [changes.get(column.name, column).label(column.name) for column in table.columns]
    rows = select(*chosen).select_from(numbers.join(table, table.c.id == image_of))
    session.execute(insert(kind).from_select([column.name for column in table.columns], rows, include_defaults=False))


def _copy_job_rows(session: Session, kind: type[Base], image_of: str, numbers: FromClause) -> None:
    """Insert copies of all rows of one job for each number."""
    table = kind.__table__
    which = numbers.c.number
    own = {"id": _FIRST + which * 100 + table.c.position, "job_id": _build_text("j", _WIDE + which)}
    chosen = [own.get(column.name, column).label(column.name) for column in table.columns]
    rows = select(*chosen).select_from(numbers.join(table, table.c.job_id == image_of))
    session.execute(insert(kind).from_select([column.name for column in table.columns], rows, include_defaults=False))


def _build_text(prefix: str, number: ColumnElement[Any]) -> ColumnElement[str]:
    return literal(prefix, String()) + cast(number, String)


def _divide(number: ColumnElement[Any], divisor: int) -> ColumnElement[int]:
    return cast((number - number % divisor) / divisor, Integer)
