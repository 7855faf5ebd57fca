"""Inserts a row that another process may be inserting as well, on either database. Knows no table by itself."""

from __future__ import annotations

from typing import Any, cast

from sqlalchemy import CursorResult
from sqlalchemy.dialects import postgresql, sqlite
from sqlalchemy.orm import Session

from service.store import models


def insert_if_new(session: Session, table: type[models.Base], **values: object) -> bool:
    """Insert a row, unless one with the same unique values is there; whether it was inserted."""
    insert = postgresql.insert if session.get_bind().dialect.name == "postgresql" else sqlite.insert
    done = session.execute(insert(table).values(**values).on_conflict_do_nothing())
    return cast("CursorResult[Any]", done).rowcount > 0
