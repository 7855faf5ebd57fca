"""Activity log: each entry is written in the same transaction as the change that it records."""

from __future__ import annotations

import getpass
import socket
from dataclasses import dataclass
from datetime import datetime
from typing import Any

from sqlalchemy import select
from sqlalchemy.orm import Session

from service.store.engine import now
from service.store.tables.installation import Audit


@dataclass(frozen=True, slots=True)
class AuditEntry:
    """An entry of the activity log."""

    at: datetime
    actor: str
    action: str
    detail: dict[str, Any]


def describe_current_user() -> str:
    """Return the account and machine that run this command, as ``account@host``."""
    try:
        account = getpass.getuser()
    except (KeyError, OSError):
        account = "unknown"
    return f"{account}@{socket.gethostname()}"


def record_action(session: Session, actor: str, action: str, subject: str, subject_id: str, **detail: object) -> None:
    """Record that ``actor`` did ``action`` to the row ``subject_id`` of the table ``subject``."""
    session.add(
        Audit(at=now(session), actor=actor, action=action, subject=subject, subject_id=subject_id, detail=detail)
    )


def load_entries(session: Session, subject: str, subject_id: str) -> list[AuditEntry]:
    """Return the activity log of a row, oldest entry first."""
    query = select(Audit).where(Audit.subject == subject, Audit.subject_id == subject_id).order_by(Audit.id)
    return [AuditEntry(row.at, row.actor, row.action, dict(row.detail)) for row in session.scalars(query)]
