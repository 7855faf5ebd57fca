"""The tables of a new SQLite database, as the migrations make them one after another, laid at once from a record.

It is only a shortcut: what the tables are the migrations decide; ``recorded_schema.py`` writes the record.
"""

from __future__ import annotations

import secrets
from datetime import UTC, datetime
from pathlib import Path

from sqlalchemy import insert, inspect
from sqlalchemy.engine import Connection

RECORD = Path(__file__).with_name("migrations") / "schema.sql"
#: Between statements; none has an empty line in it.
BETWEEN = ";\n\n"


def can_be_laid(connection: Connection) -> bool:
    """Whether this is a SQLite database with nothing in it."""
    return connection.dialect.name == "sqlite" and not inspect(connection).get_table_names()


def lay(connection: Connection, revision: str) -> None:
    """Make the tables of ``revision``, the newest, and what the migrations put into them."""
    # Imported only for a new database: commands that only ask do without the tables.
    from service.store.models import Installation

    for statement in RECORD.read_text(encoding="utf-8").split(BETWEEN):
        connection.exec_driver_sql(statement)
    connection.exec_driver_sql("INSERT INTO alembic_version VALUES (?)", (revision,))
    made = {"id": 1, "secret": secrets.token_hex(32), "made_at": datetime.now(UTC)}
    connection.execute(insert(Installation).values(made))
