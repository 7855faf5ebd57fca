"""Recorder of the schema that the migrations create: ``python -m service.store.recorded_schema``.

Run it after adding a migration; ``new_database.py`` creates tables from the record.
"""

from __future__ import annotations

import tempfile

from sqlalchemy import select
from sqlalchemy.engine import Connection

from service.store.engine import open_engine
from service.store.migrate import apply_migrations
from service.store.new_database import SCHEMA_FILE, STATEMENT_SEPARATOR
from service.store.tables.installation import SchemaCompatibility


def read_statements(connection: Connection) -> list[str]:
    """Return the statements that create the tables of a SQLite database, in order."""
    query = "SELECT sql FROM sqlite_master WHERE sql IS NOT NULL ORDER BY rowid"
    return list(connection.exec_driver_sql(query).scalars())


def write_schema() -> None:
    """Record the tables that the migrations of this checkout create."""
    with tempfile.TemporaryDirectory() as folder:
        engine = open_engine(f"sqlite:///{folder}/new.db")
        with engine.begin() as connection:
            apply_migrations(connection)
            oldest_revision = connection.scalar(select(SchemaCompatibility.oldest_compatible))
            compatibility = f"INSERT INTO {SchemaCompatibility.__tablename__} VALUES (1, '{oldest_revision}')"
            statements = [*read_statements(connection), compatibility]
            SCHEMA_FILE.write_text(STATEMENT_SEPARATOR.join(statements) + "\n", encoding="utf-8")
        engine.dispose()


if __name__ == "__main__":
    write_schema()
