"""The tables of a new SQLite database, as the migrations make them one after another, laid at once from a record.

It is only a shortcut: what the tables are the migrations decide. ``python -m service.store.recorded_schema`` writes
down anew what they make, for whoever adds one.
"""

from __future__ import annotations

import secrets
import tempfile
from datetime import UTC, datetime
from pathlib import Path

from sqlalchemy import insert, inspect, select
from sqlalchemy.engine import Connection

_FILE = Path(__file__).with_name("migrations") / "schema.sql"
#: Between statements; none has an empty line in it.
_BETWEEN = ";\n\n"


def can_be_laid(connection: Connection) -> bool:
    """Whether this is a SQLite database with nothing in it."""
    return connection.dialect.name == "sqlite" and not inspect(connection).get_table_names()


def lay(connection: Connection, revision: str) -> None:
    """Make the tables of ``revision``, the newest, and what the migrations put into them."""
    from service.store.models import Installation

    for statement in _FILE.read_text(encoding="utf-8").split(_BETWEEN):
        connection.exec_driver_sql(statement)
    connection.exec_driver_sql("INSERT INTO alembic_version VALUES (?)", (revision,))
    made = {"id": 1, "secret": secrets.token_hex(32), "made_at": datetime.now(UTC)}
    connection.execute(insert(Installation).values(made))


def statements_of(connection: Connection) -> list[str]:
    """The statements that make the tables of a SQLite database, in their order."""
    asked = "SELECT sql FROM sqlite_master WHERE sql IS NOT NULL ORDER BY rowid"
    return list(connection.exec_driver_sql(asked).scalars())


def write_schema() -> None:
    """Write down what the migrations of this checkout make."""
    from service.store.engine import open_engine
    from service.store.migrate import migrate
    from service.store.models import SchemaCompatibility

    with tempfile.TemporaryDirectory() as folder:
        engine = open_engine(f"sqlite:///{folder}/new.db")
        with engine.begin() as connection:
            migrate(connection)
            oldest = connection.scalar(select(SchemaCompatibility.oldest_compatible))
            compatibility = f"INSERT INTO {SchemaCompatibility.__tablename__} VALUES (1, '{oldest}')"
            statements = [*statements_of(connection), compatibility]
            _FILE.write_text(_BETWEEN.join(statements) + "\n", encoding="utf-8")
        engine.dispose()


if __name__ == "__main__":
    write_schema()
