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
from benchmarks.graded_store import graded_batch
from benchmarks.harness.postgresql_server import PostgresqlServer, fresh_database
from benchmarks.measurement import MILLISECONDS, Measurement, median, wall_seconds
from service.settings import load_settings
from service.store.batches import batches
from service.store.engine import Store, open_store
from service.store.models import Job
from service.store.queue import jobs

_PLANS = Path(__file__).parents[1] / "docs" / "query-plans.txt"
_TIMES = 9
_WORKER = "worker"


@dataclass(frozen=True, slots=True)
class _Question:
    """A query, and the time allowed for it."""

    name: str
    ask: Callable[[Store], object]
    milliseconds: float


def _status(store: Store) -> object:
    with store.reading() as session:
        name = many_rows.batch_name(3)
        return batches.find_batch(session, name), batches.batch(session, name), batches.progress(session, name)


def _list(store: Store) -> object:
    with store.reading() as session:
        return batches.list_batches(session)


def _marks(store: Store) -> object:
    with store.reading() as session:
        return batches.job_lines(session, many_rows.batch_name(3))


def _of_student(store: Store) -> object:
    with store.reading() as session:
        enrolment = many_rows.enrolment_of(many_rows.STUDENTS // 2)
        return session.execute(batches._job_lines().where(Job.enrolment_id == enrolment)).all()


def _show(store: Store) -> object:
    with store.reading() as session:
        return batches.find_job(session, many_rows.grade_name(70_007))


def _claim(store: Store) -> object:
    return jobs.claim(store, _WORKER, 60)


_QUESTIONS = (
    _Question("batch status: the counts of a batch of 2000", _status, 50),
    _Question("batch list: the counts of 50 batches", _list, 50),
    _Question("batch status: the marks of a batch of 2000", _marks, 300),
    _Question("all 50 grades of a student", _of_student, 50),
    _Question("a grade found by the beginning of its id", _show, 50),
    _Question("claim, 10,000 jobs waiting", _claim, 50),
)


def measure(times: int) -> list[Measurement]:
    """Measure the medians of nine or more repetitions on both databases."""
    return [
        _asked(database, store, question, max(times, _TIMES))
        for database, store in _filled()
        for question in _QUESTIONS
    ]


def _asked(database: str, store: Store, question: _Question, times: int) -> Measurement:
    seconds = _seconds(question.ask, store, times)
    what = f"{many_rows.GRADES:,} grades, {database}: {question.name}"
    told = f"most {1000 * max(seconds):.1f} ms"
    return Measurement(what, 1000 * median(seconds), MILLISECONDS, question.milliseconds, told=told)


def claim_seconds() -> float:
    """Return the seconds of a claim in PostgreSQL with 10,000 waiting jobs."""
    *_, seconds = (_seconds(_claim, store, _TIMES) for _, store in _filled())
    return median(seconds)


def main(_arguments: list[str]) -> int:
    """Write the query plans of both databases."""
    parts = [f"How {many_rows.GRADES:,} grades are asked; written by python -m benchmarks plans.\n"]
    for database, store in _filled():
        for question in _QUESTIONS:
            parts.append(f"\n== {database}: {question.name}\n")
            parts += [f"\n{plan}\n" for plan in _plans(store, question)]
    _PLANS.write_text("".join(parts))
    return 0


def _seconds(ask: Callable[[Store], object], store: Store, times: int) -> list[float]:
    return [wall_seconds(lambda: ask(store)) for _ in range(times)]


def _filled() -> Iterator[tuple[str, Store]]:
    """Yield both databases in turn. Each is removed before the next."""
    with tempfile.TemporaryDirectory() as folder, PostgresqlServer() as server:
        for database, url in (("SQLite", ""), ("PostgreSQL", fresh_database(server.url))):
            with open_store(load_settings(home=Path(folder), database_url=url)) as store:
                many_rows.fill(store, graded_batch(store))
                if url:
                    # Autovacuum does this within minutes. For SQLite, the service doesn't do it either.
                    with store.engine.connect().execution_options(isolation_level="AUTOCOMMIT") as connection:
                        connection.exec_driver_sql("VACUUM ANALYZE")
                yield database, store


def _plans(store: Store, question: _Question) -> list[str]:
    """Return the plan of each statement of a query."""
    asked: dict[str, Any] = {}

    def note(_connection: object, _cursor: object, statement: str, parameters: Any, *_: object) -> None:
        if statement.startswith(("SELECT", "WITH")) and "FROM" in statement:
            asked.setdefault(statement, parameters)

    event.listen(store.engine, "before_cursor_execute", note)
    try:
        question.ask(store)
    finally:
        event.remove(store.engine, "before_cursor_execute", note)
    with store.engine.connect() as connection:
        sqlite = connection.dialect.name == "sqlite"
        explain = "EXPLAIN QUERY PLAN " if sqlite else "EXPLAIN (ANALYZE, COSTS OFF, TIMING OFF, SUMMARY OFF) "
        plans = []
        for statement, parameters in asked.items():
            found = connection.exec_driver_sql(explain + statement, parameters).all()
            plans.append("\n".join("  " + str(row[-1]) for row in found))
        return plans
