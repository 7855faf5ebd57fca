"""Insert that tolerates the same row from another process, on either database. Independent of the tables."""

from __future__ import annotations

from sqlalchemy.orm import Session

from service.store.tables.base import Base


def insert_if_new(session: Session, table: type[Base], **values: object) -> bool:
    """Insert a row unless one with the same unique values exists. Return whether it was inserted."""
    # Only one dialect is imported: each takes longer than the rest of a simple command.
    if session.get_bind().dialect.name == "postgresql":
        from sqlalchemy.dialects.postgresql import insert
    else:
        from sqlalchemy.dialects.sqlite import insert  # type: ignore[assignment]
    statement = insert(table).values(**values).on_conflict_do_nothing().returning(*table.__mapper__.primary_key)
    return session.execute(statement).first() is not None
