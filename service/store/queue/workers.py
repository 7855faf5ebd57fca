"""Live and quarantined workers. Each worker updates its heartbeat every few seconds until it exits.

Jobs store their owners; ``self_tests.py`` decides on quarantine.
"""

from __future__ import annotations

from dataclasses import dataclass
from datetime import datetime, timedelta

from sqlalchemy import BindParameter, ColumnElement, delete, select
from sqlalchemy.orm import Session

from service.store.engine import Store, now, retry_conflicts, select_clock
from service.store.tables.installation import Heartbeat, Worker

#: A worker with a heartbeat within this time is considered alive.
ALIVE_PERIOD = timedelta(seconds=30)
_RETENTION = timedelta(days=1)


@dataclass(frozen=True, slots=True)
class WorkerDescription:
    """A worker's description of itself."""

    name: str
    host: str
    concurrency: int  # gradings at a time
    grader_version: str
    sandbox: str  # sandbox layers on that machine
    problem: str = ""  # why it must be restarted


@dataclass(frozen=True, slots=True)
class WorkerLine:
    """A worker and the time it was last seen."""

    worker: WorkerDescription
    started_at: datetime
    seen_at: datetime
    lately: bool


@dataclass(frozen=True, slots=True)
class QuarantinedWorker:
    """A worker that failed a self-test, and the reason."""

    worker: str
    since: datetime
    reason: str


@retry_conflicts
def record_heartbeat(store: Store, worker: WorkerDescription) -> None:
    """Store the worker's heartbeat. Deletes workers that were last seen more than a day ago."""
    with store.transaction() as session:
        current_time = now(session)
        row = session.get(Heartbeat, worker.name)
        if row is None:
            session.execute(delete(Heartbeat).where(Heartbeat.seen_at < current_time - _RETENTION))
            row = Heartbeat(worker=worker.name, started_at=current_time)
            session.add(row)
        row.host, row.concurrency = worker.host, worker.concurrency
        row.grader_version, row.sandbox = worker.grader_version, worker.sandbox
        row.problem = worker.problem or None
        row.seen_at = current_time


@retry_conflicts
def delete_heartbeat(store: Store, name: str) -> None:
    """Delete the heartbeat of a worker that has exited."""
    with store.transaction() as session:
        session.execute(delete(Heartbeat).where(Heartbeat.worker == name))


def load_workers(session: Session) -> list[WorkerLine]:
    """Return all workers with a heartbeat, ordered by name."""
    rows = session.execute(select(Heartbeat, select_clock(session)).order_by(Heartbeat.worker)).all()
    return [
        WorkerLine(
            WorkerDescription(
                row.worker, row.host, row.concurrency, row.grader_version, row.sandbox, row.problem or ""
            ),
            row.started_at,
            row.seen_at,
            row.seen_at > current_time - ALIVE_PERIOD,
        )
        for row, current_time in rows
    ]


def match_other_live_worker(worker: BindParameter[str], since: BindParameter[datetime]) -> ColumnElement[bool]:
    """Return the condition that another worker was seen after ``since``."""
    return select(Heartbeat.worker).where(Heartbeat.worker != worker, Heartbeat.seen_at > since).exists()


def is_in_quarantine(session: Session, worker: str, *, lock: bool = False) -> bool:
    """Return whether the worker is barred from claiming and finishing.

    ``lock`` keeps this until the transaction ends.
    """
    query = select(Worker.quarantined_at).where(Worker.name == worker)
    return session.scalar(query.with_for_update(read=True) if lock else query) is not None


def list_quarantined_workers(session: Session) -> list[QuarantinedWorker]:
    """Return all quarantined workers, newest first."""
    query = select(Worker).where(Worker.quarantined_at.is_not(None)).order_by(Worker.quarantined_at.desc())
    return [
        QuarantinedWorker(row.name, row.quarantined_at, row.reason or "")
        for row in session.scalars(query)
        if row.quarantined_at is not None
    ]
