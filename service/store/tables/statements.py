"""Tables of signed statements: the keys, the log of statements, and the heads of the log that were written.

``service.statements`` defines what is signed.
"""

from __future__ import annotations

from datetime import datetime

from sqlalchemy import LargeBinary, String
from sqlalchemy.orm import Mapped, mapped_column

from service.store.ids import LENGTH as ID_LENGTH
from service.store.tables.base import Base


class StatementKey(Base):
    """An Ed25519 key; the newest one that is neither retired nor revoked signs."""

    __tablename__ = "statement_key"

    id: Mapped[str] = mapped_column(String(16), primary_key=True)
    public_hex: Mapped[str] = mapped_column(String(64))
    private_hex: Mapped[str | None] = mapped_column(String(64))  # removed when the key no longer signs
    created_at: Mapped[datetime]
    retired_at: Mapped[datetime | None]
    revoked_at: Mapped[datetime | None]


class StatementEntry(Base):
    """An entry of the log, numbered from 0 without gaps. Entries are never deleted, and only their data is erased.

    The references have no foreign keys: an entry remains when its grade is removed.
    """

    __tablename__ = "statement_entry"

    number: Mapped[int] = mapped_column(primary_key=True, autoincrement=False)
    leaf_sha256: Mapped[str] = mapped_column(String(64))
    made_at: Mapped[datetime]
    submission_id: Mapped[int | None] = mapped_column(index=True)
    job_id: Mapped[str | None] = mapped_column(String(ID_LENGTH))
    # The leaf is the hash of salt, signature and payload. All of these are None after the student's data was erased.
    salt: Mapped[str | None] = mapped_column(String(64))
    opening_key: Mapped[str | None] = mapped_column(String(64))
    key_id: Mapped[str | None] = mapped_column(String(16))
    signature: Mapped[str | None] = mapped_column(String(128))
    payload: Mapped[bytes | None] = mapped_column(LargeBinary, deferred=True)


class StatementHead(Base):
    """A head of the log that was written to be filed."""

    __tablename__ = "statement_head"

    id: Mapped[int] = mapped_column(primary_key=True)
    size: Mapped[int]
    root_sha256: Mapped[str] = mapped_column(String(64))
    made_at: Mapped[datetime]
