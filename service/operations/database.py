"""Database maintenance by commands on the machine: upgrade, backup, restore and purge."""

from __future__ import annotations

from datetime import datetime
from pathlib import Path

from service.operations.context import Actor, Service
from service.operations.lookup import check_machine
from service.settings import Settings
from service.store import backup, purge
from service.store.engine import open_engine, open_store
from service.store.purge import PurgeCounts
from service.store.revision import find_newest_revision
from sim.errors import UsageError


def upgrade(settings: Settings) -> str:
    """Upgrade the tables to this release and return their revision. Raises like ``open_store``."""
    open_store(settings).close()
    return find_newest_revision()


def back_up(settings: Settings, file: Path) -> int:
    """Copy the database, in use or not, into a new file. Returns its size in bytes.

    Raises UsageError if there is no database yet or the file exists, HostError if the copy fails.
    """
    engine = open_engine(settings.database)
    if engine.dialect.name == "sqlite" and not Path(str(engine.url.database)).exists():
        raise UsageError(f"there is no database yet at {engine.url.database}")
    try:
        backup.back_up(engine, file)
    finally:
        engine.dispose()
    return file.stat().st_size


def restore(service: Service, actor: Actor, file: Path) -> str:
    """Restore a backup into a database without submissions. Returns the database's address without its password.

    Raises:
        Forbidden: The actor is not a command on the machine.
        UsageError: The file is not a backup, or the database is not empty.
        HostError: The backup was made by a newer release.
    """
    check_machine(actor)
    backup.restore(file, service.store.engine)
    return service.store.engine.url.render_as_string(hide_password=True)


def remove_old_submissions(service: Service, actor: Actor, cutoff: datetime, *, only_count: bool) -> PurgeCounts:
    """Remove submissions from before a moment, with grades, recordings, and students without remaining submissions.

    With ``only_count``, return what would be removed.

    Raises Forbidden unless called by a command.
    """
    check_machine(actor)
    return purge.purge_submissions(service.store, cutoff, actor.name, only_count=only_count)
