"""Frequent queries do not scan all jobs."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
from sqlalchemy import event
from sqlalchemy.orm import Session

from builders import accept_one, opened, settings_in
from service.store.batches import batches, job_lines
from service.store.engine import Store, now
from service.store.queue.scheduling import find_next_job


@pytest.fixture
def sqlite(tmp_path: Path) -> Iterator[Store]:
    with opened(settings_in(tmp_path)) as store:
        yield store


@pytest.mark.parametrize(
    "ask",
    [
        lambda session: find_next_job(session, now(session), "worker"),
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
