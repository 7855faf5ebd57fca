"""At which revision a database's tables are, and which one this release needs: one value read, nothing changed.

Bringing them there is ``migrate.py``'s.
"""

from __future__ import annotations

from pathlib import Path

from sqlalchemy import Engine, column, inspect, select, table
from sqlalchemy.engine import Connection

_TABLE = "alembic_version"


def newest_revision() -> str:
    """The revision that this release needs; a migration's file is called after its own: ``v0009_people.py``."""
    files = (Path(__file__).parent / "migrations" / "versions").glob("v*.py")
    return max(file.name[1:5] for file in files)


def current_revision(engine: Engine) -> str | None:
    """The revision the database is at; None for an empty one."""
    with engine.begin() as connection:
        return revision_of(connection)


def revision_of(connection: Connection) -> str | None:
    """The revision the database is at, asked in a transaction of the caller's; None for an empty one."""
    if not inspect(connection).has_table(_TABLE):
        return None
    found: str | None = connection.scalar(select(column("version_num")).select_from(table(_TABLE)))
    return found
