"""Which workers live and which are in quarantine: each writes down every few seconds that it lives, until its end.

Says nothing of what they hold; that is in the jobs. What puts one into quarantine is in ``self_tests.py``.
"""

from __future__ import annotations

from dataclasses import dataclass
from datetime import datetime, timedelta

from sqlalchemy import ColumnElement, delete, select
from sqlalchemy.orm import Session

from service.store.engine import Store, now, retry_conflicts
from service.store.models import Heartbeat, Worker

#: A worker that wrote within this time is taken to live.
LATELY = timedelta(seconds=30)
_FORGOTTEN = timedelta(days=1)


@dataclass(frozen=True, slots=True)
class WorkerDescription:
    """One worker, as it describes itself."""

    name: str
    host: str
    concurrency: int  # gradings at a time
    grader_version: str
    sandbox: str  # what stands round student code there
    problem: str = ""  # why it must be restarted


@dataclass(frozen=True, slots=True)
class WorkerLine:
    """A worker, and when it was last heard of."""

    worker: WorkerDescription
    started_at: datetime
    seen_at: datetime
    lately: bool


@dataclass(frozen=True, slots=True)
class InQuarantine:
    """A worker that got a known answer wrong, and how."""

    worker: str
    since: datetime
    reason: str


@retry_conflicts
def beat(store: Store, worker: WorkerDescription) -> None:
    """Write down that the worker lives now. Those that fell silent a day ago are forgotten."""
    with store.transaction() as session:
        at = now(session)
        row = session.get(Heartbeat, worker.name)
        if row is None:
            session.execute(delete(Heartbeat).where(Heartbeat.seen_at < at - _FORGOTTEN))
            row = Heartbeat(worker=worker.name, started_at=at)
            session.add(row)
        row.host, row.concurrency = worker.host, worker.concurrency
        row.grader_version, row.sandbox = worker.grader_version, worker.sandbox
        row.problem = worker.problem or None
        row.seen_at = at


@retry_conflicts
def forget(store: Store, name: str) -> None:
    """Take away the row of a worker that has ended."""
    with store.transaction() as session:
        session.execute(delete(Heartbeat).where(Heartbeat.worker == name))


def known_workers(session: Session) -> list[WorkerLine]:
    """All workers that are written down, by name."""
    at = now(session)
    rows = session.scalars(select(Heartbeat).order_by(Heartbeat.worker))
    return [
        WorkerLine(
            WorkerDescription(
                row.worker, row.host, row.concurrency, row.grader_version, row.sandbox, row.problem or ""
            ),
            row.started_at,
            row.seen_at,
            row.seen_at > at - LATELY,
        )
        for row in rows
    ]


def another_lives(worker: str, at: datetime) -> ColumnElement[bool]:
    """Whether a worker other than this one was heard of lately, as a condition."""
    return select(Heartbeat.worker).where(Heartbeat.worker != worker, Heartbeat.seen_at > at - LATELY).exists()


def is_in_quarantine(session: Session, worker: str, *, lock: bool = False) -> bool:
    """Whether the worker may neither claim nor finish; with ``lock`` that stays so to the transaction's end."""
    query = select(Worker.quarantined_at).where(Worker.name == worker)
    return session.scalar(query.with_for_update(read=True) if lock else query) is not None


def in_quarantine(session: Session) -> list[InQuarantine]:
    """All workers in quarantine, the latest first."""
    query = select(Worker).where(Worker.quarantined_at.is_not(None)).order_by(Worker.quarantined_at.desc())
    return [
        InQuarantine(row.name, row.quarantined_at, row.reason or "")
        for row in session.scalars(query)
        if row.quarantined_at is not None
    ]
