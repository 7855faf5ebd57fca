"""Replies to requests with an idempotency key, so that repeating a request returns the same reply.

The interface decides which requests have keys, and when two requests are the same.
"""

from __future__ import annotations

from dataclasses import dataclass
from datetime import timedelta

from sqlalchemy import delete, select, update

from service.operations.context import Actor, Service
from service.store.conditional_insert import insert_if_new
from service.store.engine import now, retry_conflicts
from service.store.tables.installation import IdempotentReply

#: Time for which a key identifies the same request.
RETENTION = timedelta(hours=24)
#: Requests that started earlier and never finished were interrupted by a stop of the server.
_ABANDONED = timedelta(minutes=15)
_UNFINISHED = 0


@dataclass(frozen=True, slots=True)
class StoredReply:
    """A stored reply."""

    request_sha256: str
    status: int
    body: bytes


class InProgress(Exception):
    """The first request with this key is still in progress."""


@retry_conflicts
def reserve_key(service: Service, actor: Actor, key: str) -> StoredReply | None:
    """Return the reply for this key; None if the key is new, which reserves it. Raises InProgress."""
    is_own = (IdempotentReply.credential_id == actor.credential_id, IdempotentReply.key == key)
    with service.store.transaction() as session:
        current_time = now(session)
        session.execute(delete(IdempotentReply).where(IdempotentReply.made_at < current_time - RETENTION))
        is_abandoned = (IdempotentReply.status == _UNFINISHED, IdempotentReply.made_at < current_time - _ABANDONED)
        session.execute(delete(IdempotentReply).where(*is_own, *is_abandoned))
        reservation = {
            "credential_id": actor.credential_id,
            "key": key,
            "request_sha256": "",
            "status": _UNFINISHED,
            "body": b"",
        }
        if insert_if_new(session, IdempotentReply, **reservation, made_at=current_time):
            return None
        row = session.scalars(select(IdempotentReply).where(*is_own)).one()
        if row.status == _UNFINISHED:
            raise InProgress
        return StoredReply(row.request_sha256, row.status, row.body)


@retry_conflicts
def store_reply(service: Service, actor: Actor, key: str, reply: StoredReply) -> None:
    """Store the reply for this key."""
    is_own = (IdempotentReply.credential_id == actor.credential_id, IdempotentReply.key == key)
    values = {"request_sha256": reply.request_sha256, "status": reply.status, "body": reply.body}
    with service.store.transaction() as session:
        session.execute(update(IdempotentReply).where(*is_own).values(**values))


@retry_conflicts
def release_key(service: Service, actor: Actor, key: str) -> None:
    """Release the key of a failed request."""
    is_own = (IdempotentReply.credential_id == actor.credential_id, IdempotentReply.key == key)
    with service.store.transaction() as session:
        session.execute(delete(IdempotentReply).where(*is_own))
