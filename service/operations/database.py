"""The database of an installation: upgraded, backed up, restored and purged by commands on the machine itself."""

from __future__ import annotations

from datetime import datetime
from pathlib import Path

from service.operations.context import Actor, Service
from service.operations.lookup import check_machine
from service.settings import Settings
from service.store import backup, purge
from service.store.engine import open_engine, open_store
from service.store.purge import Purged
from service.store.revision import newest_revision
from sim.errors import UsageError


def upgrade(settings: Settings) -> str:
    """Bring the tables up to this release; returns their revision. Raises as ``open_store`` does."""
    open_store(settings).close()
    return newest_revision()


def back_up(settings: Settings, file: Path) -> int:
    """Copy the database as it is, in use or not, into a new file; returns its size in bytes.

    Raises UsageError where there is no database yet or the file exists, HostError where the copy fails.
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
    """Restore a backup into a database without submissions; returns the database's address without its password.

    Raises Forbidden for anybody but commands, UsageError for a file that is no backup and a database that is not empty,
    HostError for a backup of a newer release.
    """
    check_machine(actor)
    backup.restore(file, service.store.engine)
    return service.store.engine.url.render_as_string(hide_password=True)


def count_old(service: Service, actor: Actor, before: datetime) -> Purged:
    """How much ``remove_old`` would remove. Raises Forbidden for anybody but commands."""
    check_machine(actor)
    return purge.purge(service.store, before, actor.name, only_count=True)


def remove_old(service: Service, actor: Actor, before: datetime) -> Purged:
    """Remove the submissions from before a moment, with grades, recordings and students who have nothing left.

    Raises Forbidden for anybody but commands.
    """
    check_machine(actor)
    return purge.purge(service.store, before, actor.name)
