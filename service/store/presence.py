"""Which workers live: each writes down every few seconds that it does, and takes its row away at its end.

Says nothing of what they hold; that is in the jobs.
"""

from __future__ import annotations

from dataclasses import dataclass
from datetime import datetime, timedelta

from sqlalchemy import ColumnElement, delete, select
from sqlalchemy.orm import Session

from service.store.engine import Store, now
from service.store.models import Presence

#: A worker that wrote within this time is taken to live.
LATELY = timedelta(seconds=30)
_FORGOTTEN = timedelta(days=1)


@dataclass(frozen=True, slots=True)
class Worker:
    """One worker, as it describes itself."""

    name: str
    host: str
    concurrency: int  # gradings at a time
    grader_version: str
    walls: str  # what stands round student code there


@dataclass(frozen=True, slots=True)
class Seen:
    """A worker, and when it was last heard of."""

    worker: Worker
    started_at: datetime
    seen_at: datetime
    lately: bool


def tell(store: Store, worker: Worker) -> None:
    """Write down that the worker lives now. Those that fell silent a day ago are forgotten."""
    with store.transaction() as session:
        at = now(session)
        row = session.get(Presence, worker.name)
        if row is None:
            session.execute(delete(Presence).where(Presence.seen_at < at - _FORGOTTEN))
            row = Presence(worker=worker.name, started_at=at)
            session.add(row)
        row.host, row.concurrency = worker.host, worker.concurrency
        row.grader_version, row.walls = worker.grader_version, worker.walls
        row.seen_at = at


def forget(store: Store, name: str) -> None:
    """Take away the row of a worker that has ended."""
    with store.transaction() as session:
        session.execute(delete(Presence).where(Presence.worker == name))


def workers(session: Session) -> list[Seen]:
    """All workers that are written down, by name."""
    at = now(session)
    rows = session.scalars(select(Presence).order_by(Presence.worker))
    return [
        Seen(
            Worker(row.worker, row.host, row.concurrency, row.grader_version, row.walls),
            row.started_at,
            row.seen_at,
            row.seen_at > at - LATELY,
        )
        for row in rows
    ]


def another_lives(worker: str, at: datetime) -> ColumnElement[bool]:
    """Whether a worker other than this one was heard of lately, as a condition."""
    return select(Presence.worker).where(Presence.worker != worker, Presence.seen_at > at - LATELY).exists()
