"""Frequent queries do not scan all jobs."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
from sqlalchemy import event, insert, select, text
from sqlalchemy.orm import Session

from builders import accept_one, grading_request, opened, settings_in
from job_choice import choose_job
from service.store.batches import batches, job_lines
from service.store.batches.intake import accept_batch
from service.store.engine import Store
from service.store.queue import jobs
from service.store.states import Standing
from service.store.tables.submissions import Job


@pytest.fixture
def sqlite(tmp_path: Path) -> Iterator[Store]:
    with opened(settings_in(tmp_path)) as store:
        yield store


@pytest.mark.parametrize(
    "ask",
    [
        choose_job,
        batches.list_batches,
        lambda session: batches.load_progress(session, "none"),
        lambda session: job_lines.load_job_lines(session, "none"),
    ],
    ids=["claim", "batch list", "how far a batch is", "marks of a batch"],
)
def test_no_question_walks_through_all_jobs(sqlite: Store, ask: Callable[[Session], object]) -> None:
    accept_one(sqlite)
    plans = _plans(sqlite, ask)
    assert any("SEARCH job" in line for line in plans)
    assert [line for line in plans if line.startswith("SCAN job")] == []


def test_batches_are_counted_without_reading_their_jobs(sqlite: Store) -> None:
    assert any("SEARCH job USING COVERING INDEX" in line for line in _plans(sqlite, batches.list_batches))


def test_a_claim_does_the_same_work_for_few_and_for_many_waiting_jobs(sqlite: Store) -> None:
    students = ["ada", "bob", "cid"]
    for name in ("first", "second"):
        accept_batch(
            sqlite, name, [grading_request(student, f"print('{name}')\n") for student in students], [], max_attempts=3
        )
    assert jobs.claim_job(sqlite, "worker", 60) is not None
    few = _count_steps(sqlite)
    _copy_waiting_jobs(sqlite, 1000)
    assert _count_steps(sqlite) < 1.2 * few


def test_a_claim_reads_waiting_and_started_jobs_from_indexes(sqlite: Store) -> None:
    accept_batch(sqlite, "batch", [grading_request("ada")], [], max_attempts=3)
    read = [line for line in _plans(sqlite, choose_job) if "job" in line]
    indexes = ("ix_job_waiting", "ix_job_started_at_lane_batch_id_enrolment_id", "sqlite_autoindex_job_1")
    assert [line for line in read if not any(index in line for index in indexes)] == []


def _count_steps(store: Store) -> int:
    """Return the steps, in tens, of SQLite's virtual machine for the choice of the next job."""
    steps = []
    with store.reading() as session:
        connection = session.connection().connection.driver_connection
        connection.set_progress_handler(lambda: steps.append(10), 10)  # type: ignore[union-attr]
        assert choose_job(session) is not None
    return len(steps)


def _copy_waiting_jobs(store: Store, count: int) -> None:
    """Add copies of each waiting job, which wait behind it."""
    with store.transaction() as session:
        table = Job.__table__
        rows = [dict(row._mapping) for row in session.execute(select(table).where(table.c.state == "queued"))]
        copies = [
            row | {"id": f"z{number}-{row['id'][:6]}", "standing": Standing.KEPT}
            for row in rows
            for number in range(count)
        ]
        session.execute(insert(Job), copies)


def _plans(store: Store, ask: Callable[[Session], object]) -> list[str]:
    statements: list[tuple[str, tuple[object, ...]]] = []

    def note(_connection: object, _cursor: object, statement: str, parameters: tuple[object, ...], *_: object) -> None:
        statements.append((statement, parameters))

    event.listen(store.engine, "before_cursor_execute", note)
    with store.reading() as session:
        ask(session)
    event.remove(store.engine, "before_cursor_execute", note)
    with store.engine.connect() as connection:
        return [
            str(row[-1])
            for statement, parameters in statements
            for row in connection.exec_driver_sql("EXPLAIN QUERY PLAN " + statement, parameters)
        ]


def test_a_claim_is_two_statements(store: Store) -> None:
    accept_batch(store, "batch", [grading_request(name) for name in ("ada", "bob")], [], max_attempts=3)
    statements: list[str] = []
    event.listen(store.engine, "before_cursor_execute", lambda *arguments: statements.append(arguments[2]))
    assert jobs.claim_job(store, "worker", 60) is not None
    assert len([each for each in statements if not each.startswith(("BEGIN", "PRAGMA"))]) == 2


@pytest.mark.long
def test_postgresql_plans_the_first_statement_of_a_claim_only_at_the_start(store: Store) -> None:
    if store.engine.dialect.name == "sqlite":
        pytest.skip("SQLite keeps no plans")
    accept_batch(store, "batch", [grading_request(f"student-{number}") for number in range(20)], [], max_attempts=3)
    for _ in range(20):
        assert jobs.claim_job(store, "worker", 60) is not None
    with store.reading() as session:
        query = text("SELECT custom_plans, generic_plans FROM pg_prepared_statements WHERE statement LIKE 'WITH REC%'")
        ((custom_plans, generic_plans),) = session.execute(query)
    assert custom_plans <= 5
    assert generic_plans >= 5
