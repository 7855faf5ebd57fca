"""A database as the first release left it, with data: kept as SQLite's SQL, laid out on either engine.

Of its five jobs two have a grade, one was superseded, one is dead and one waits; made by that release itself.
"""

from __future__ import annotations

import sqlite3
from pathlib import Path

from alembic import command
from sqlalchemy import Column, Engine, Integer, MetaData, Table, create_engine, insert, inspect, select, text

from paths import DATA
from service.store.columns import SafeText
from service.store.engine import open_engine
from service.store.migrate import configuration
from service.store.web_tables import METADATA

REVISION = "0002"
#: What columns of then are called today.
_TODAY = {"nudged_at": "notified_at", "walls": "sandbox", "sights": "predictions", "problems": "refusals"}
#: What columns that are gone kept.
_GONE = {"name": SafeText(), "email": SafeText()}
_SQL = DATA / "first_release.sql"


def lay_first_release(url: str, folder: Path) -> Engine:
    """The tables and rows of the first release in the empty database at ``url``; ``folder`` is for a copy."""
    engine = open_engine(url)
    file = Path(engine.url.database or "") if engine.dialect.name == "sqlite" else folder / "first.db"
    connection = sqlite3.connect(file)
    connection.executescript(_SQL.read_text(encoding="utf-8"))
    connection.close()
    if engine.dialect.name != "sqlite":
        _copy(file, engine)
    return engine


def _copy(file: Path, engine: Engine) -> None:
    with engine.begin() as connection:
        command.upgrade(configuration(connection), REVISION)
    source = create_engine(f"sqlite:///{file}")
    names = set(inspect(source).get_table_names())
    with source.connect() as old, engine.begin() as new:
        for today in METADATA.sorted_tables:
            if today.name not in names:
                continue
            # The columns of then, with today's types, which read what SQLite has and write what PostgreSQL wants.
            then = [column["name"] for column in inspect(source).get_columns(today.name)]
            kinds = _GONE | {column.name: column.type for column in today.c}
            columns = [Column(name, kinds[_TODAY.get(name, name)]) for name in then]
            table = Table(today.name, MetaData(), *columns)
            rows = [dict(row._mapping) for row in old.execute(select(table))]
            if rows:
                new.execute(insert(table), rows)
            if rows and isinstance(today.c["id"].type, Integer):
                last = f"(SELECT max(id) FROM {today.name})"
                new.execute(text(f"SELECT setval(pg_get_serial_sequence('{today.name}', 'id'), {last})"))
    source.dispose()
