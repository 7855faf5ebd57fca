"""Writes down the tables that the migrations make, for new databases: ``python -m service.store.recorded_schema``.

Run it after adding a migration; ``new_database.py`` lays the tables from the record.
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
    """The statements that make the tables of a SQLite database, in their order."""
    asked = "SELECT sql FROM sqlite_master WHERE sql IS NOT NULL ORDER BY rowid"
    return list(connection.exec_driver_sql(asked).scalars())


def write_schema() -> None:
    """Write down what the migrations of this checkout make."""
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
