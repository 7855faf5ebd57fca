"""Queries on a database with 100,000 grades, on SQLite and on PostgreSQL, and their query plans.

``python -m benchmarks plans`` writes the plans of both to ``docs/query-plans.txt``.
"""

from __future__ import annotations

import tempfile
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from sqlalchemy import event

from benchmarks import many_rows
from benchmarks.graded_store import create_graded_batch
from benchmarks.harness.postgresql_server import PostgresqlServer, create_database
from benchmarks.measurement import MILLISECONDS, Measurement, measure_wall_seconds, median
from service.settings import load_settings
from service.store.batches import batches, job_lines
from service.store.engine import Store, open_store
from service.store.queue import jobs
from service.store.tables.submissions import Job

_PLANS = Path(__file__).parents[1] / "docs" / "query-plans.txt"
_TIMES = 9
_WORKER = "worker"


@dataclass(frozen=True, slots=True)
class _TimedQuery:
    """A query, and the time allowed for it."""

    name: str
    ask: Callable[[Store], object]
    milliseconds: float


def _query_status(store: Store) -> object:
    with store.reading() as session:
        name = many_rows.format_batch_name(3)
        return (
            batches.find_batch(session, name),
            batches.load_batch(session, name),
            batches.load_progress(session, name),
        )


def _query_batches(store: Store) -> object:
    with store.reading() as session:
        return batches.list_batches(session)


def _query_marks(store: Store) -> object:
    with store.reading() as session:
        return job_lines.load_job_lines(session, many_rows.format_batch_name(3))


def _query_student(store: Store) -> object:
    with store.reading() as session:
        enrolment = many_rows.compute_enrolment_id(many_rows.STUDENTS // 2)
        return session.execute(job_lines._select_job_lines().where(Job.enrolment_id == enrolment)).all()


def _query_grade(store: Store) -> object:
    with store.reading() as session:
        return batches.find_job(session, many_rows.format_grade_name(70_007))


def _claim(store: Store) -> object:
    return jobs.claim_job(store, _WORKER, 60)


_QUERIES = (
    _TimedQuery("batch status: the counts of a batch of 2000", _query_status, 50),
    _TimedQuery("batch list: the counts of 50 batches", _query_batches, 50),
    _TimedQuery("batch status: the marks of a batch of 2000", _query_marks, 300),
    _TimedQuery("all 50 grades of a student", _query_student, 50),
    _TimedQuery("a grade found by the beginning of its id", _query_grade, 50),
    _TimedQuery("claim, 10,000 jobs waiting", _claim, 50),
)


def measure(times: int) -> list[Measurement]:
    """Measure the medians of nine or more repetitions on both databases."""
    return [
        _measure_query(database, store, question, max(times, _TIMES))
        for database, store in fill_databases()
        for question in _QUERIES
    ]


def _measure_query(database: str, store: Store, question: _TimedQuery, times: int) -> Measurement:
    seconds = _time_query(question.ask, store, times)
    title = f"{many_rows.GRADES:,} grades, {database}: {question.name}"
    details = f"most {1000 * max(seconds):.1f} ms"
    return Measurement(title, 1000 * median(seconds), MILLISECONDS, question.milliseconds, details=details)


def measure_claim() -> float:
    """Return the seconds of a claim in PostgreSQL with 10,000 waiting jobs."""
    *_, seconds = (_time_query(_claim, store, _TIMES) for _, store in fill_databases())
    return median(seconds)


def main(_arguments: list[str]) -> int:
    """Write the query plans of both databases."""
    parts = [f"How {many_rows.GRADES:,} grades are asked; written by python -m benchmarks plans.\n"]
    for database, store in fill_databases():
        for question in _QUERIES:
            parts.append(f"\n== {database}: {question.name}\n")
            parts += [f"\n{plan}\n" for plan in _collect_plans(store, question)]
    _PLANS.write_text("".join(parts))
    return 0


def _time_query(ask: Callable[[Store], object], store: Store, times: int) -> list[float]:
    return [measure_wall_seconds(lambda: ask(store)) for _ in range(times)]


def fill_databases() -> Iterator[tuple[str, Store]]:
    """Yield both databases in turn. Each is removed before the next."""
    with tempfile.TemporaryDirectory() as folder, PostgresqlServer() as server:
        for database, url in (("SQLite", ""), ("PostgreSQL", create_database(server.url))):
            with open_store(load_settings(home=Path(folder), database_url=url)) as store:
                many_rows.fill(store, create_graded_batch(store))
                vacuum(store)
                yield database, store


def vacuum(store: Store) -> None:
    """Do for PostgreSQL what autovacuum does within minutes. For SQLite, the service doesn't do it either."""
    if store.engine.dialect.name == "postgresql":
        with store.engine.connect().execution_options(isolation_level="AUTOCOMMIT") as connection:
            connection.exec_driver_sql("VACUUM ANALYZE")


def _collect_plans(store: Store, question: _TimedQuery) -> list[str]:
    """Return the plan of each statement of a query."""
    statements: dict[str, Any] = {}

    def record_statement(_connection: object, _cursor: object, statement: str, parameters: Any, *_: object) -> None:
        if statement.startswith(("SELECT", "WITH")) and "FROM" in statement:
            statements.setdefault(statement, parameters)

    event.listen(store.engine, "before_cursor_execute", record_statement)
    try:
        question.ask(store)
    finally:
        event.remove(store.engine, "before_cursor_execute", record_statement)
    with store.engine.connect() as connection:
        sqlite = connection.dialect.name == "sqlite"
        explain = "EXPLAIN QUERY PLAN " if sqlite else "EXPLAIN (ANALYZE, COSTS OFF, TIMING OFF, SUMMARY OFF) "
        plans = []
        for statement, parameters in statements.items():
            plan_rows = connection.exec_driver_sql(explain + statement, parameters).all()
            plans.append("\n".join("  " + str(row[-1]) for row in plan_rows))
        return plans
