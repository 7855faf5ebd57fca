"""Brings a database's tables up to this release, once, however many processes start at the same time.

There is no way down: an older Robomark refuses a newer database.
"""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from sqlalchemy import Engine, text
from sqlalchemy.engine import Connection

from service.store import new_database
from service.store.revision import newest_revision, revision_of
from sim.errors import HostError

if TYPE_CHECKING:
    from alembic.config import Config

#: An arbitrary number that all Robomarks share: PostgreSQL's advisory lock for migrations.
_LOCK = 0x526F626F


def configuration(connection: Connection) -> Config:
    """Alembic's configuration for the scripts inside this package, on an open connection."""
    # It takes as long to load as all that a command which only asks needs.
    from alembic.config import Config

    config = Config()
    config.set_main_option("script_location", str(Path(__file__).parent / "migrations").replace("%", "%%"))
    config.attributes["connection"] = connection
    return config


def refuse_downgrade() -> None:
    """What every revision does when asked to be taken back: raise HostError."""
    raise HostError("A database cannot be taken back to an older Robomark; restore the backup made before the upgrade.")


def upgrade(engine: Engine) -> None:
    """Apply what is missing, in one transaction under a lock.

    Raises HostError if the database was made by a newer Robomark.
    """
    with engine.begin() as connection:
        # SQLite holds its write lock since BEGIN IMMEDIATE.
        if engine.dialect.name == "postgresql":
            connection.execute(text("SELECT pg_advisory_xact_lock(:key)"), {"key": _LOCK})
        if revision_of(connection) == newest_revision():
            return
        if new_database.can_be_laid(connection):
            new_database.lay(connection, newest_revision())
        else:
            migrate(connection)


def migrate(connection: Connection) -> None:
    """Apply one migration after another. Raises HostError if the database was made by a newer Robomark."""
    from alembic import command
    from alembic.script import ScriptDirectory

    config = configuration(connection)
    present = revision_of(connection)
    known = {script.revision for script in ScriptDirectory.from_config(config).walk_revisions()}
    if present is not None and present not in known:
        raise HostError(
            f"The database was made by a newer Robomark (its tables are at {present}); "
            "upgrade this Robomark, or restore a backup: there is no way down."
        )
    command.upgrade(config, "head")
