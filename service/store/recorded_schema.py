"""Recorder of the schema that the migrations create: ``python -m service.store.recorded_schema``.

Run it after adding a migration; ``new_database.py`` creates tables from the record.
"""

from __future__ import annotations

import tempfile

from sqlalchemy import select
from sqlalchemy.engine import Connection

from service.store.engine import open_engine
from service.store.migrate import migrate
from service.store.models import SchemaCompatibility
from service.store.new_database import BETWEEN, RECORD


def statements_of(connection: Connection) -> list[str]:
    """Return the statements that create the tables of a SQLite database, in order."""
    asked = "SELECT sql FROM sqlite_master WHERE sql IS NOT NULL ORDER BY rowid"
    return list(connection.exec_driver_sql(asked).scalars())


def write_schema() -> None:
    """Record the tables that the migrations of this checkout create."""
    with tempfile.TemporaryDirectory() as folder:
        engine = open_engine(f"sqlite:///{folder}/new.db")
        with engine.begin() as connection:
            migrate(connection)
            oldest = connection.scalar(select(SchemaCompatibility.oldest_compatible))
            compatibility = f"INSERT INTO {SchemaCompatibility.__tablename__} VALUES (1, '{oldest}')"
            statements = [*statements_of(connection), compatibility]
            RECORD.write_text(BETWEEN.join(statements) + "\n", encoding="utf-8")
        engine.dispose()


if __name__ == "__main__":
    write_schema()
