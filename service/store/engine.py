"""Database connections and transactions: SQLite in a file, or PostgreSQL by URL.

Independent of the tables and of the statements in a transaction.
"""

from __future__ import annotations

import os
import sqlite3
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass, replace
from datetime import UTC, datetime
from functools import wraps
from pathlib import Path
from typing import Any, ParamSpec, Self, TypeVar

from sqlalchemy import ColumnElement, Engine, create_engine, event, func, literal, make_url, select
from sqlalchemy.engine import Connection
from sqlalchemy.exc import DBAPIError, NoResultFound, OperationalError
from sqlalchemy.orm import Session
from sqlalchemy.orm.exc import ObjectDeletedError, StaleDataError
from sqlalchemy.pool import NullPool

from service.home import open_home
from service.settings import Settings
from service.store.columns import UtcDateTime
from service.store.migrate import upgrade_database
from service.store.revision import load_schema_state
from sim.errors import HostError
from submissions.seeds import Secret

SQLITE_BUSY_SECONDS = 30
IMPATIENT_SECONDS = 0.5
_ONLY_READS = "robomark_only_reads"
_READ_AT = "robomark_read_at"
_BUSY_SECONDS = "robomark_busy_seconds"
#: SQLSTATE of transactions that PostgreSQL aborted because of another: deadlock, serialization failure.
_CONFLICTS = ("40P01", "40001")
#: A row with the same unique values exists now, or the row of a foreign key is missing: SQLSTATE and SQLite's names.
_OVERTAKEN = ("23505", "23503", "SQLITE_CONSTRAINT_UNIQUE", "SQLITE_CONSTRAINT_FOREIGNKEY")

P = ParamSpec("P")
R = TypeVar("R")


def is_conflict(error: BaseException) -> bool:
    """Return whether the database aborted a transaction because of another one, so that a retry can succeed."""
    return _find_sqlstate(error) in _CONFLICTS


def is_overtaken(error: BaseException) -> bool:
    """Return whether another transaction inserted the same row, or removed a row that this one relied on."""
    is_gone = isinstance(error, NoResultFound | StaleDataError | ObjectDeletedError)
    return is_gone or _find_sqlstate(error) in _OVERTAKEN


def _find_sqlstate(error: BaseException) -> str | None:
    """Return the SQLSTATE of an error, or SQLite's name for it."""
    orig = error.orig if isinstance(error, DBAPIError) else None
    return getattr(orig, "sqlstate", None) or getattr(orig, "sqlite_errorname", None)


def retry_conflicts(transact: Callable[P, R]) -> Callable[P, R]:
    """Decorate a function that is one transaction: run it a second time if the first was aborted by a conflict."""

    @wraps(transact)
    def transact_again(*args: P.args, **kwargs: P.kwargs) -> R:
        try:
            return transact(*args, **kwargs)
        except DBAPIError as error:
            if not is_conflict(error):
                raise
        return transact(*args, **kwargs)

    return transact_again


@dataclass(frozen=True, slots=True)
class Store:
    """An open database. Can be shared between threads, but not across a fork."""

    engine: Engine
    secret: Secret | None = None  # from the environment; overrides the database's own

    @contextmanager
    def transaction(self) -> Iterator[Session]:
        """Open a transaction: committed at the end, rolled back by any exception.

        On SQLite it takes the write lock immediately (BEGIN IMMEDIATE), so its reads cannot become stale.
        """
        with Session(self.engine, expire_on_commit=False) as session, session.begin():
            yield session

    @contextmanager
    def reading(self) -> Iterator[Session]:
        """Open a read-only transaction whose statements all see the same rows, and whose clock stands still.

        On SQLite it does not block writers.
        """
        options: dict[str, Any] = {_ONLY_READS: True}
        if self.engine.dialect.name == "postgresql":
            # Otherwise, a row that another transaction deletes could be missing in the second statement of a page.
            options["isolation_level"] = "REPEATABLE READ"
        engine = self.engine.execution_options(**options)
        with Session(engine, expire_on_commit=False, info={_ONLY_READS: True}) as session, session.begin():
            yield session

    @contextmanager
    def short_transactions(self) -> Iterator[Connection]:
        """Open a connection on which each statement is a transaction, which saves PostgreSQL two messages.

        On SQLite they are one transaction like ``transaction``, because a process then waits only once.
        """
        if self.engine.dialect.name == "sqlite":
            with self.engine.begin() as connection:
                yield connection
        else:
            with self.engine.connect() as connection:
                yield connection.execution_options(isolation_level="AUTOCOMMIT")

    def with_short_wait(self) -> Store:
        """Return the same database for transactions that fail instead of waiting long for SQLite's write lock."""
        return replace(self, engine=self.engine.execution_options(**{_BUSY_SECONDS: IMPATIENT_SECONDS}))

    def close(self) -> None:
        """Close the pooled connections."""
        self.engine.dispose()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()


def open_engine(url: str) -> Engine:
    """Return an engine with Robomark's settings; creates the folder of a SQLite file.

    Errors do not include the values of a statement, because the installation's secret may be one. Raises HostError if
    the folder cannot be created.
    """
    database_url = make_url(url)
    if database_url.get_backend_name() != "sqlite":
        return create_engine(database_url, pool_pre_ping=True, pool_size=2, max_overflow=8, hide_parameters=True)
    if database_url.database and database_url.database != ":memory:":
        folder = Path(database_url.database).absolute().parent
        try:
            folder.mkdir(mode=0o700, parents=True, exist_ok=True)
        except OSError as error:
            raise HostError(f"The folder for the database cannot be made: {folder}: {error.strerror}") from None
    # One connection per transaction: finished threads leave none open.
    engine = create_engine(
        database_url, poolclass=NullPool, connect_args={"timeout": SQLITE_BUSY_SECONDS}, hide_parameters=True
    )
    event.listen(engine, "connect", _prepare_sqlite)
    event.listen(engine, "begin", _begin_immediate)
    return engine


def _prepare_sqlite(connection: sqlite3.Connection, _record: object) -> None:
    # Python's transaction handling emits no BEGIN before a SELECT, so two workers could claim one job.
    connection.isolation_level = None
    cursor = connection.cursor()
    for pragma in ("journal_mode = WAL", "synchronous = NORMAL", "foreign_keys = ON"):
        cursor.execute(f"PRAGMA {pragma}")
    cursor.close()


def _begin_immediate(connection: Connection) -> None:
    options = connection.get_execution_options()
    only_reads = options.get(_ONLY_READS, False)
    if _BUSY_SECONDS in options:
        # The connection is closed after its only transaction.
        connection.exec_driver_sql(f"PRAGMA busy_timeout = {int(options[_BUSY_SECONDS] * 1000)}")
    connection.exec_driver_sql("BEGIN" if only_reads else "BEGIN IMMEDIATE")


def open_store(settings: Settings) -> Store:
    """Open the database of these settings and upgrade its tables.

    Raises HostError if it cannot be reached or needs a newer Robomark, UsageError if other users share the home folder.
    """
    database_url = make_url(settings.database)
    file = Path(str(database_url.database)).absolute() if database_url.get_backend_name() == "sqlite" else None
    if file is not None and settings.home in file.parents:
        open_home(settings.home)
    engine = open_engine(settings.database)
    if file is not None:
        # Private before it contains data; SQLite creates its companion files with the same mode.
        with suppress(OSError):
            os.close(os.open(file, os.O_CREAT | os.O_EXCL | os.O_CLOEXEC, 0o600))
    try:
        if not load_schema_state(engine.execution_options(**{_ONLY_READS: True})).is_usable:
            upgrade_database(engine)
    except OperationalError as error:
        engine.dispose()
        shown_url = engine.url.render_as_string(hide_password=True)
        raise HostError(f"The database {shown_url} cannot be used: {error.orig}") from None
    except BaseException:
        engine.dispose()
        raise
    return Store(engine, settings.own_secret)


def now(session: Session) -> datetime:
    """Return the database's clock, so that leases agree on every machine; for SQLite, this machine's clock.

    A transaction that only reads asks for it once. Others may have waited for a lock since they last asked.
    """
    moment = session.info.get(_READ_AT)
    if moment is None:
        is_sqlite = session.get_bind().dialect.name == "sqlite"
        moment = datetime.now(UTC) if is_sqlite else session.scalars(select(select_clock(session))).one()
        if session.info.get(_ONLY_READS):
            session.info[_READ_AT] = moment
    assert isinstance(moment, datetime)
    return moment


def select_clock(session: Session) -> ColumnElement[datetime]:
    """Return the clock of ``now`` as an expression, for statements that read it with rows or compare it with them."""
    if session.get_bind().dialect.name == "sqlite":
        return literal(datetime.now(UTC), UtcDateTime())
    return func.clock_timestamp(type_=UtcDateTime())
