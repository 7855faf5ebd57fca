"""Replies to requests with a key, so that a repeated request gets the same reply and changes nothing.

The interface decides which requests have keys, and when two are the same.
"""

from __future__ import annotations

from dataclasses import dataclass
from datetime import timedelta

from sqlalchemy import delete, select, update

from service.operations.context import Actor, Service
from service.store.engine import now, retry_conflicts
from service.store.inserting import insert_if_new
from service.store.web_tables import IdempotentReply

#: For so long a key stands for the same request.
KEPT = timedelta(hours=24)
#: What was begun so long ago and never ended was ended by the server's end.
_ABANDONED = timedelta(minutes=15)
_BEGUN = 0


@dataclass(frozen=True, slots=True)
class KeptReply:
    """An answer that was given."""

    request_sha256: str
    status: int
    body: bytes


class InProgress(Exception):
    """The first request with this key is not answered yet."""


@retry_conflicts
def begin(service: Service, actor: Actor, key: str) -> KeptReply | None:
    """What was answered to this key; None where it is new, and is held from now on. Raises InProgress."""
    mine = (IdempotentReply.credential_id == actor.credential_id, IdempotentReply.key == key)
    with service.store.transaction() as session:
        at = now(session)
        session.execute(delete(IdempotentReply).where(IdempotentReply.made_at < at - KEPT))
        abandoned = (IdempotentReply.status == _BEGUN, IdempotentReply.made_at < at - _ABANDONED)
        session.execute(delete(IdempotentReply).where(*mine, *abandoned))
        held = {"credential_id": actor.credential_id, "key": key, "request_sha256": "", "status": _BEGUN, "body": b""}
        if insert_if_new(session, IdempotentReply, **held, made_at=at):
            return None
        row = session.scalars(select(IdempotentReply).where(*mine)).one()
        if row.status == _BEGUN:
            raise InProgress
        return KeptReply(row.request_sha256, row.status, row.body)


@retry_conflicts
def keep(service: Service, actor: Actor, key: str, reply: KeptReply) -> None:
    """Write down what was answered."""
    mine = (IdempotentReply.credential_id == actor.credential_id, IdempotentReply.key == key)
    values = {"request_sha256": reply.request_sha256, "status": reply.status, "body": reply.body}
    with service.store.transaction() as session:
        session.execute(update(IdempotentReply).where(*mine).values(**values))


@retry_conflicts
def forget(service: Service, actor: Actor, key: str) -> None:
    """Nothing came of the request, so the key is free again."""
    mine = (IdempotentReply.credential_id == actor.credential_id, IdempotentReply.key == key)
    with service.store.transaction() as session:
        session.execute(delete(IdempotentReply).where(*mine))
