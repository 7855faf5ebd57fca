"""Opens the database and gives out transactions: SQLite in a file, or PostgreSQL by URL.

Knows neither tables nor what is done in a transaction.
"""

from __future__ import annotations

import os
import sqlite3
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import Self

from sqlalchemy import Engine, create_engine, event, func, make_url, select
from sqlalchemy.engine import Connection
from sqlalchemy.exc import OperationalError
from sqlalchemy.orm import Session
from sqlalchemy.pool import NullPool

from service.home import open_home
from service.settings import Settings
from service.store.migrate import upgrade
from service.store.revision import current_revision, newest_revision
from sim.errors import HostError
from submissions.seeds import Secret

SQLITE_BUSY_SECONDS = 30
_ONLY_READS = "robomark_only_reads"


@dataclass(frozen=True, slots=True)
class Store:
    """The open database. Safe to share between threads; not across a fork."""

    engine: Engine
    secret: Secret | None = None  # of the environment; it wins over the database's own

    @contextmanager
    def transaction(self) -> Iterator[Session]:
        """One transaction: committed at the end, rolled back by any exception.

        On SQLite it takes the write lock at once (BEGIN IMMEDIATE), so nothing read in it can go stale.
        """
        with Session(self.engine, expire_on_commit=False) as session, session.begin():
            yield session

    @contextmanager
    def reading(self) -> Iterator[Session]:
        """One transaction that only reads; on SQLite it keeps no writer waiting."""
        engine = self.engine.execution_options(**{_ONLY_READS: True})
        with Session(engine, expire_on_commit=False) as session, session.begin():
            yield session

    def close(self) -> None:
        """Close the connections that are kept for later."""
        self.engine.dispose()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()


def open_engine(url: str) -> Engine:
    """An engine with the settings that Robomark needs; makes the folder of a SQLite file.

    No error tells the values of a statement: the installation's secret is one.

    Raises HostError when the folder cannot be made.
    """
    parsed = make_url(url)
    if parsed.get_backend_name() != "sqlite":
        return create_engine(parsed, pool_pre_ping=True, pool_size=2, max_overflow=8, hide_parameters=True)
    if parsed.database and parsed.database != ":memory:":
        folder = Path(parsed.database).absolute().parent
        try:
            folder.mkdir(mode=0o700, parents=True, exist_ok=True)
        except OSError as error:
            raise HostError(f"The folder for the database cannot be made: {folder}: {error.strerror}") from None
    # One connection a transaction: nothing stays open in threads that came and went.
    engine = create_engine(
        parsed, poolclass=NullPool, connect_args={"timeout": SQLITE_BUSY_SECONDS}, hide_parameters=True
    )
    event.listen(engine, "connect", _prepare_sqlite)
    event.listen(engine, "begin", _begin_immediate)
    return engine


def _prepare_sqlite(connection: sqlite3.Connection, _record: object) -> None:
    # Python's own transaction handling emits no BEGIN before a SELECT, which lets two workers claim one job.
    connection.isolation_level = None
    cursor = connection.cursor()
    for pragma in ("journal_mode = WAL", "synchronous = NORMAL", "foreign_keys = ON"):
        cursor.execute(f"PRAGMA {pragma}")
    cursor.close()


def _begin_immediate(connection: Connection) -> None:
    only_reads = connection.get_execution_options().get(_ONLY_READS, False)
    connection.exec_driver_sql("BEGIN" if only_reads else "BEGIN IMMEDIATE")


def open_store(settings: Settings) -> Store:
    """The database of these settings, brought up to the newest tables.

    Raises HostError when it cannot be reached or is newer than this Robomark, UsageError for a home that others share.
    """
    parsed = make_url(settings.database)
    file = Path(str(parsed.database)).absolute() if parsed.get_backend_name() == "sqlite" else None
    if file is not None and settings.home in file.parents:
        open_home(settings.home)
    engine = open_engine(settings.database)
    if file is not None:
        # Ours alone before anything is in it; SQLite gives what it lays beside it the same mode.
        with suppress(OSError):
            os.close(os.open(file, os.O_CREAT | os.O_EXCL | os.O_CLOEXEC, 0o600))
    try:
        if current_revision(engine.execution_options(**{_ONLY_READS: True})) != newest_revision():
            upgrade(engine)
    except OperationalError as error:
        engine.dispose()
        where = engine.url.render_as_string(hide_password=True)
        raise HostError(f"The database {where} cannot be used: {error.orig}") from None
    except BaseException:
        engine.dispose()
        raise
    return Store(engine, settings.own_secret)


def now(session: Session) -> datetime:
    """The database's clock, so that leases mean the same on every machine; SQLite's machine is ours."""
    if session.get_bind().dialect.name == "sqlite":
        return datetime.now(UTC)
    moment = session.scalars(select(func.clock_timestamp())).one()
    assert isinstance(moment, datetime)
    return moment.astimezone(UTC)
