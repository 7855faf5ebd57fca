"""The choice of the next job, without taking it."""

from __future__ import annotations

from sqlalchemy.orm import Session

from service.store.queue.scheduling import find_choices


def choose_job(session: Session, worker: str = "worker") -> str | None:
    """Return the id of the job that a claim would take; on PostgreSQL, its row stays locked in the transaction."""
    turn = find_choices(session.connection(), worker)
    assert turn is not None
    rows = (session.connection().execute(choice.query, choice.parameters).first() for choice in turn[1])
    return next((str(row.id) for row in rows if row is not None), None)
