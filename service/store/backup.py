"""Backup of a whole database into a SQLite file, and restore from one into an empty database.

Source and target may be of different kinds, so a backup also moves an installation. ``purge.py`` removes old data.
"""

from __future__ import annotations

import os
import sqlite3
import tempfile
from collections.abc import Iterator, Mapping, Sequence
from contextlib import closing, contextmanager
from pathlib import Path
from typing import Any

from sqlalchemy import Column, Engine, Table, bindparam, delete, func, insert, select, text, update
from sqlalchemy.engine import Connection, RowMapping
from sqlalchemy.exc import DataError, DBAPIError, IntegrityError, OperationalError, SQLAlchemyError

from service.store.engine import open_engine
from service.store.migrate import upgrade_database
from service.store.revision import find_newest_revision, load_current_revision, load_schema_state
from service.store.tables import METADATA
from service.store.tables.courses import Course
from service.store.tables.installation import Installation, SchemaCompatibility
from service.store.tables.submissions import Job
from sim.errors import HostError, UsageError

#: Small, because some rows contain a recording.
_ROWS_AT_A_TIME = 50
#: Errors of SQLAlchemy and of the types of columns while rows of a damaged file are read.
_READ_ERRORS = (SQLAlchemyError, ArithmeticError, LookupError, TypeError, ValueError)
_MAX_REASON_LENGTH = 120
_EXPECTED = "expected a file that robomark db backup made"


class _UnreadableRowError(Exception):
    """A row of the source cannot be read."""


def back_up(source: Engine, file: Path) -> None:
    """Copy a database, in use or not, into a new ``file`` that only this user can read.

    Removes the partial file on failure.

    Raises:
        UsageError: ``file`` exists already.
        HostError: The copy failed.
    """
    if file.exists():
        raise UsageError(f"{file} exists already; name a new file")
    try:
        os.close(os.open(file, os.O_CREAT | os.O_EXCL | os.O_CLOEXEC, 0o600))
        if source.dialect.name == "sqlite":
            _copy_file(Path(str(source.url.database)), file)
        else:
            with _open_file(file) as target:
                upgrade_database(target)
                _copy_rows(source, target)
    except (OSError, sqlite3.Error, OperationalError, _UnreadableRowError) as error:
        file.unlink(missing_ok=True)
        raise HostError(f"the database cannot be copied to {file}: {error}") from None
    except BaseException:
        file.unlink(missing_ok=True)
        raise


def restore(file: Path, target: Engine) -> None:
    """Restore a backup into an empty database of either kind, in one transaction.

    A backup of an older release is upgraded during the restore; the file itself is not changed.

    Raises:
        UsageError: The file is not a backup, or the database is not empty.
        HostError: The backup was made by a newer release.
    """
    if not file.is_file():
        raise UsageError(f"{file}: does not exist, {_EXPECTED}")
    with tempfile.TemporaryDirectory(prefix="robomark-restore-") as folder:
        snapshot = Path(folder) / "copy.db"
        try:
            _copy_file(file, snapshot)
        except sqlite3.Error as error:
            raise UsageError(
                f"{file}: cannot be read ({error}), expected a file that robomark db backup made"
            ) from None
        with _open_file(snapshot) as source:
            try:
                _prepare_source(source, file)
            except _READ_ERRORS as error:
                raise UsageError(f"{file}: is damaged ({_describe_error(error)}), {_EXPECTED}") from None
            try:
                _copy_rows(source, target)
            except (_UnreadableRowError, IntegrityError, DataError) as error:
                raise UsageError(f"{file}: is damaged ({_describe_error(error)}), {_EXPECTED}") from None


def _prepare_source(source: Engine, file: Path) -> None:
    """Upgrade the copy of a backup to this release. Raises UsageError if it is none, or one of ``_READ_ERRORS``."""
    _check_objects(source, file)
    if load_current_revision(source) is None:
        raise UsageError(f"{file}: is no database of Robomark's, {_EXPECTED}")
    upgrade_database(source)
    _check_usability(source, file)


def _check_objects(source: Engine, file: Path) -> None:
    """Raise UsageError for views and triggers. A view instead of a table could have endless rows."""
    with source.connect() as connection:
        other_kind = connection.scalar(text("SELECT type FROM sqlite_master WHERE type NOT IN ('table', 'index')"))
    if other_kind is not None:
        raise UsageError(f"{file}: has a {other_kind}, {_EXPECTED}")


def _check_usability(source: Engine, file: Path) -> None:
    """Raise UsageError if a database with these rows would be unusable."""
    with source.connect() as connection:
        installations = connection.scalar(select(func.count()).select_from(Installation))
    if installations != 1 or not load_schema_state(source).is_usable:
        raise UsageError(f"{file}: is damaged, {_EXPECTED}")


@contextmanager
def _open_file(file: Path) -> Iterator[Engine]:
    engine = open_engine(f"sqlite:///{file.absolute()}")
    try:
        yield engine
    finally:
        engine.dispose()


def _copy_file(source: Path, target: Path) -> None:
    with (
        closing(sqlite3.connect(f"{source.absolute().as_uri()}?mode=ro", uri=True)) as live,
        closing(sqlite3.connect(target)) as target_connection,
    ):
        live.backup(target_connection)


def _copy_rows(source: Engine, target: Engine) -> None:
    """Copy every row of every table from one snapshot. Raises HostError for tables of another release."""
    for engine in (source, target):
        revision = load_current_revision(engine)
        if revision != find_newest_revision():
            database_url = engine.url.render_as_string(hide_password=True)
            raise HostError(
                f"The tables of {database_url} are at revision {revision}, this Robomark copies those at "
                f"{find_newest_revision()}: use the release that they are of."
            )
    snapshot_engine = (
        source.execution_options(isolation_level="REPEATABLE READ") if source.dialect.name != "sqlite" else source
    )
    with snapshot_engine.connect() as source_connection, target.begin() as target_connection:
        if target_connection.scalar(select(func.count()).select_from(Course)) or target_connection.scalar(
            select(func.count()).select_from(Job)
        ):
            database_url = target.url.render_as_string(hide_password=True)
            raise UsageError(
                f"the database {database_url} is not empty, expected one in which nothing was submitted yet"
            )
        # Both rows were created with the target's tables and are replaced. The restored secret determines the worlds.
        target_connection.execute(delete(Installation))
        target_connection.execute(delete(SchemaCompatibility))
        for table in METADATA.sorted_tables:
            _copy_table(table, source_connection, target_connection)


def _copy_table(table: Table, source_connection: Connection, target_connection: Connection) -> None:
    """Copy a table. References within the table are set last, because a row may refer to a later one."""
    self_references = [
        column for column in table.columns if any(key.column.table is table for key in column.foreign_keys)
    ]
    reference_rows: list[dict[str, Any]] = []
    (key,) = table.primary_key.columns
    for chunk in _read_chunks(table, source_connection):
        target_connection.execute(insert(table), [_clear_columns(row, self_references) for row in chunk])
        reference_rows += [
            {"of": row[key.name], **{column.name: row[column.name] for column in self_references}}
            for row in chunk
            if any(row[column.name] is not None for column in self_references)
        ]
    if reference_rows:
        values: dict[str, Any] = {column.name: bindparam(column.name) for column in self_references}
        target_connection.execute(update(table).where(key == bindparam("of")).values(values), reference_rows)
    last_key = target_connection.scalar(select(func.max(key)))
    if target_connection.dialect.name == "postgresql" and isinstance(last_key, int):
        # New rows get the next free numbers.
        sequence = func.pg_get_serial_sequence(table.name, key.name)
        target_connection.execute(select(func.setval(sequence, last_key)))


def _read_chunks(table: Table, connection: Connection) -> Iterator[Sequence[RowMapping]]:
    """Yield the rows of a table. Raises _UnreadableRowError."""
    try:
        rows = connection.execution_options(yield_per=_ROWS_AT_A_TIME).execute(select(table)).mappings()
        while chunk := rows.fetchmany(_ROWS_AT_A_TIME):
            yield chunk
    except _READ_ERRORS as error:
        raise _UnreadableRowError(f"{table.name}: {_describe_error(error)}") from None


def _describe_error(error: Exception) -> str:
    """Return the reason in one line, without the statement that SQLAlchemy adds."""
    reason = str(error.orig if isinstance(error, DBAPIError) else error)
    return " ".join(reason.split())[:_MAX_REASON_LENGTH]


def _clear_columns(row: Mapping[Any, Any], columns: list[Column[Any]]) -> dict[str, Any]:
    return dict(row) | {column.name: None for column in columns}
