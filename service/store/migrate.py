"""Creation of a database's tables, and their upgrade to this release, once with any number of concurrent processes.

Downgrades are not supported: an older Robomark rejects a newer database.
"""

from __future__ import annotations

import secrets
from datetime import UTC, datetime
from pathlib import Path
from typing import TYPE_CHECKING

from sqlalchemy import Engine, delete, insert, inspect, text
from sqlalchemy.engine import Connection

from service.store.revision import OLDEST_COMPATIBLE, find_newest_revision, read_revision
from sim.errors import HostError

if TYPE_CHECKING:
    from alembic.config import Config

#: Arbitrary but fixed key of PostgreSQL's advisory lock for migrations.
_LOCK = 0x526F626F


def build_alembic_config(connection: Connection) -> Config:
    """Return Alembic's configuration for the scripts in this package, on an open connection."""
    # Importing it takes as long as everything else in a read-only command.
    from alembic.config import Config

    config = Config()
    config.set_main_option("script_location", str(Path(__file__).parent / "migrations").replace("%", "%%"))
    config.attributes["connection"] = connection
    return config


def refuse_downgrade() -> None:
    """Raise HostError: the downgrade function of every revision."""
    raise HostError("A database cannot be taken back to an older Robomark; restore the backup made before the upgrade.")


def upgrade_database(engine: Engine) -> None:
    """Apply the missing migrations in one transaction, under a lock.

    Raises HostError if the database was made by a newer Robomark.
    """
    with engine.begin() as connection:
        # SQLite already has its write lock from BEGIN IMMEDIATE.
        if engine.dialect.name == "postgresql":
            connection.execute(text("SELECT pg_advisory_xact_lock(:key)"), {"key": _LOCK})
        if read_revision(connection) == find_newest_revision():
            return
        if is_empty_sqlite(connection):
            create_tables(connection)
        else:
            apply_migrations(connection)


def is_empty_sqlite(connection: Connection) -> bool:
    """Return whether this is an empty SQLite database."""
    return connection.dialect.name == "sqlite" and not inspect(connection).get_table_names()


def create_tables(connection: Connection) -> None:
    """Create all tables of an empty SQLite database, which is faster than one migration after another."""
    # Imported only for a new database: read-only commands do not need the tables.
    from service.store.tables import METADATA
    from service.store.tables.installation import Installation

    METADATA.create_all(connection, checkfirst=False)
    values = {"id": 1, "secret": secrets.token_hex(32), "made_at": datetime.now(UTC)}
    connection.execute(insert(Installation).values(values))
    connection.exec_driver_sql("CREATE TABLE alembic_version (version_num VARCHAR(32) NOT NULL PRIMARY KEY)")
    connection.exec_driver_sql("INSERT INTO alembic_version VALUES (?)", (find_newest_revision(),))
    _record_compatibility(connection)


def apply_migrations(connection: Connection) -> None:
    """Apply the missing migrations one by one. Raises HostError if the database was made by a newer Robomark."""
    from alembic import command
    from alembic.script import ScriptDirectory

    config = build_alembic_config(connection)
    current_revision = read_revision(connection)
    known_revisions = {script.revision for script in ScriptDirectory.from_config(config).walk_revisions()}
    if current_revision is not None and current_revision not in known_revisions:
        raise HostError(
            f"The database was made by a newer Robomark (its tables are at {current_revision}); "
            "upgrade this Robomark, or restore a backup: there is no way down."
        )
    command.upgrade(config, "head")
    _record_compatibility(connection)


def _record_compatibility(connection: Connection) -> None:
    from service.store.tables.installation import SchemaCompatibility

    connection.execute(delete(SchemaCompatibility))
    connection.execute(insert(SchemaCompatibility).values(id=1, oldest_compatible=OLDEST_COMPATIBLE))
