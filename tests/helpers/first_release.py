"""Databases of earlier releases with data, stored as SQLite SQL and restored on either engine.

Each was made by the release itself. The first has five jobs: two with a grade, one superseded, one dead, one waiting.
The one of 0.2.0 also has published grades, a batch of regrades, a policy and an extension.
"""

from __future__ import annotations

import sqlite3
from pathlib import Path

from alembic import command
from sqlalchemy import Column, Engine, Integer, MetaData, Table, create_engine, delete, insert, inspect, select, text

from paths import DATA
from service.store.columns import SafeText
from service.store.engine import open_engine
from service.store.migrate import build_alembic_config
from service.store.tables import METADATA

#: The file and the revision of each database.
_FIRST, _SECOND = ("first_release.sql", "0002"), ("release_0_2_0.sql", "0008")
#: New names of renamed columns.
_TODAY = {"nudged_at": "notified_at", "walls": "sandbox", "sights": "predictions", "problems": "refusals"}
#: Former content of removed columns.
_GONE = {"name": SafeText(), "email": SafeText()}


def lay_first_release(url: str, folder: Path) -> Engine:
    """Restore the first release in the empty database at ``url``; ``folder`` receives a copy."""
    return _lay(url, folder, *_FIRST)


def lay_release_0_2_0(url: str, folder: Path) -> Engine:
    """Restore release 0.2.0 in the same way."""
    return _lay(url, folder, *_SECOND)


def _lay(url: str, folder: Path, sql: str, revision: str) -> Engine:
    engine = open_engine(url)
    file = Path(engine.url.database or "") if engine.dialect.name == "sqlite" else folder / "first.db"
    connection = sqlite3.connect(file)
    connection.executescript((DATA / sql).read_text(encoding="utf-8"))
    connection.close()
    if engine.dialect.name != "sqlite":
        _copy(file, engine, revision)
    return engine


def _copy(file: Path, engine: Engine, revision: str) -> None:
    with engine.begin() as connection:
        command.upgrade(build_alembic_config(connection), revision)
    source = create_engine(f"sqlite:///{file}")
    names = set(inspect(source).get_table_names())
    with source.connect() as old, engine.begin() as new:
        for today in METADATA.sorted_tables:
            if today.name not in names:
                continue
            # The columns of that release with today's types, which read SQLite's values and write PostgreSQL's.
            then = [column["name"] for column in inspect(source).get_columns(today.name)]
            kinds = _GONE | {column.name: column.type for column in today.c}
            columns = [Column(name, kinds[_TODAY.get(name, name)]) for name in then]
            table = Table(today.name, MetaData(), *columns)
            rows = [dict(row._mapping) for row in old.execute(select(table))]
            if rows:
                # The migrations create the row of the installation.
                new.execute(delete(table))
                new.execute(insert(table), rows)
            if rows and isinstance(today.c["id"].type, Integer):
                last = f"(SELECT max(id) FROM {today.name})"
                new.execute(text(f"SELECT setval(pg_get_serial_sequence('{today.name}', 'id'), {last})"))
    source.dispose()
