"""Inserts a row that another process may be inserting as well, on either database. Knows no table by itself."""

from __future__ import annotations

from sqlalchemy.orm import Session

from service.store import models


def insert_if_new(session: Session, table: type[models.Base], **values: object) -> bool:
    """Insert a row, unless one with the same unique values is there; whether it was inserted."""
    # The other database's dialect takes longer to import than a command that only asks takes for the rest.
    if session.get_bind().dialect.name == "postgresql":
        from sqlalchemy.dialects.postgresql import insert
    else:
        from sqlalchemy.dialects.sqlite import insert  # type: ignore[assignment]
    made = insert(table).values(**values).on_conflict_do_nothing().returning(*table.__mapper__.primary_key)
    return session.execute(made).first() is not None
