"""Tables of the installation: its secret, the compatibility of the schema, workers, the activity log, stored replies.

The jobs that workers run are in ``submissions.py``.
"""

from __future__ import annotations

from datetime import datetime
from typing import Any

from sqlalchemy import ForeignKey, Index, LargeBinary, String
from sqlalchemy.orm import Mapped, mapped_column

from service.store.tables.base import Base


class Installation(Base):
    """The installation: one row, created with the tables."""

    __tablename__ = "installation"

    id: Mapped[int] = mapped_column(primary_key=True)
    secret: Mapped[str] = mapped_column(String(64))  # determines the seeds of trials; never shown
    made_at: Mapped[datetime]


class SchemaCompatibility(Base):
    """Schema compatibility: one row, written by the migrations."""

    __tablename__ = "schema_compatibility"

    id: Mapped[int] = mapped_column(primary_key=True)
    oldest_compatible: Mapped[str] = mapped_column(String(32))  # oldest revision whose code can use the tables


class Worker(Base):
    """A worker that has run a self-test. After a failed one it is in quarantine and claims no jobs."""

    __tablename__ = "worker"

    name: Mapped[str] = mapped_column(primary_key=True)
    grader_version: Mapped[str]
    grader_sha256: Mapped[str] = mapped_column(String(64))
    first_at: Mapped[datetime]
    self_tested_at: Mapped[datetime]  # time of the last self-test, passed or failed
    quarantined_at: Mapped[datetime | None]
    reason: Mapped[str | None]


class SelfTest(Base):
    """The last passed self-test of a worker process; its later grades are not confirmed yet."""

    __tablename__ = "self_test"
    __table_args__ = (Index(None, "worker", "process", unique=True),)

    id: Mapped[int] = mapped_column(primary_key=True)
    worker: Mapped[str]
    process: Mapped[int]
    right_at: Mapped[datetime]


class Heartbeat(Base):
    """A live worker, or one that was alive recently.

    It updates its row every few seconds and deletes it when it exits.
    """

    __tablename__ = "heartbeat"

    worker: Mapped[str] = mapped_column(primary_key=True)
    host: Mapped[str]
    concurrency: Mapped[int]  # gradings at a time
    grader_version: Mapped[str]
    sandbox: Mapped[str]  # sandbox layers on that machine
    problem: Mapped[str | None]  # why it must be restarted
    started_at: Mapped[datetime]
    seen_at: Mapped[datetime] = mapped_column(index=True)


class Audit(Base):
    """Activity log; never deleted, and changed only to erase the name of a person."""

    __tablename__ = "audit"
    __table_args__ = (Index(None, "subject", "subject_id"),)

    id: Mapped[int] = mapped_column(primary_key=True)
    at: Mapped[datetime] = mapped_column(index=True)
    actor: Mapped[str]
    action: Mapped[str]
    subject: Mapped[str] = mapped_column(String(32))  # name of a table
    subject_id: Mapped[str]
    detail: Mapped[Any] = mapped_column(default=dict)


class IdempotentReply(Base):
    """The reply to a request with an idempotency key, so that repeating the request changes nothing."""

    __tablename__ = "idempotent_reply"
    __table_args__ = (Index(None, "credential_id", "key", unique=True),)

    id: Mapped[int] = mapped_column(primary_key=True)
    credential_id: Mapped[str] = mapped_column(ForeignKey("credential.id"))
    key: Mapped[str]
    request_sha256: Mapped[str] = mapped_column(String(64))
    status: Mapped[int]
    body: Mapped[bytes] = mapped_column(LargeBinary)
    made_at: Mapped[datetime] = mapped_column(index=True)
