"""Creation of a new SQLite database from a recorded schema instead of one migration after another.

Only a shortcut: the migrations define the tables, and ``recorded_schema.py`` writes the record.
"""

from __future__ import annotations

import secrets
from datetime import UTC, datetime
from pathlib import Path

from sqlalchemy import insert, inspect
from sqlalchemy.engine import Connection

SCHEMA_FILE = Path(__file__).with_name("migrations") / "schema.sql"
#: Separates statements, which contain no empty lines.
STATEMENT_SEPARATOR = ";\n\n"


def is_empty_sqlite(connection: Connection) -> bool:
    """Return whether this is an empty SQLite database."""
    return connection.dialect.name == "sqlite" and not inspect(connection).get_table_names()


def create_tables(connection: Connection, revision: str) -> None:
    """Create the tables of ``revision``, which is the newest, and the rows that the migrations insert."""
    # Imported only for a new database: read-only commands do not need the tables.
    from service.store.tables.installation import Installation

    for statement in SCHEMA_FILE.read_text(encoding="utf-8").split(STATEMENT_SEPARATOR):
        connection.exec_driver_sql(statement)
    connection.exec_driver_sql("INSERT INTO alembic_version VALUES (?)", (revision,))
    installation_values = {"id": 1, "secret": secrets.token_hex(32), "made_at": datetime.now(UTC)}
    connection.execute(insert(Installation).values(installation_values))
