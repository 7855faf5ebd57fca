"""``robomark db``: bring the tables up to date, copy all there is, bring it back, and remove what is old.

What is copied and what goes is decided in ``store/backup.py`` and ``store/purge.py``.
"""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from service.settings import load_settings
from service.store import audit
from service.store.backup import back_up, restore
from service.store.engine import open_engine, open_store
from service.store.migrate import newest_revision
from service.store.purge import purge
from sim.errors import UsageError
from submissions.roster import moment

database_app = typer.Typer(help="Look after the database.", no_args_is_help=True)


@database_app.command("upgrade")
def upgrade_tables() -> None:
    """Bring the tables up to this release; every command does it when it starts."""
    open_store(load_settings()).close()
    print(f"the database is at revision {newest_revision()}")


@database_app.command("backup")
def backup_database(file: Annotated[Path, typer.Argument(help="The copy to make; it must not exist.")]) -> None:
    """Copy the database while it is in use: a SQLite file that can be opened as it is, and is for you alone."""
    settings = load_settings()
    engine = open_engine(settings.database)
    if engine.dialect.name == "sqlite" and not Path(str(engine.url.database)).exists():
        raise UsageError(f"there is no database yet at {engine.url.database}")
    try:
        back_up(engine, file)
    finally:
        engine.dispose()
    print(f"{file}: {file.stat().st_size} bytes")


@database_app.command("restore")
def restore_database(file: Annotated[Path, typer.Argument(help="What db backup made.")]) -> None:
    """Bring a backup into a database in which nothing was submitted yet, SQLite or PostgreSQL."""
    with open_store(load_settings()) as store:
        restore(file, store.engine)
        where = store.engine.url.render_as_string(hide_password=True)
    print(f"{where} has what {file} has")


@database_app.command("purge")
def purge_database(
    before: Annotated[str, typer.Option(help="A date, or a date and time: 2025-09-01.")],
    archive: Annotated[Path | None, typer.Option(help="Back the whole database up into this file first.")] = None,
    for_good: Annotated[bool, typer.Option("--for-good", help="Keep no copy.")] = False,
) -> None:
    """Remove what was submitted before a date, with grades, recordings and students who have nothing left.

    Without --archive or --for-good it says how much would go.
    """
    try:
        earliest_kept = moment(before)
    except ValueError:
        raise UsageError(f"--before {before}: expected a date like 2025-09-01") from None
    if archive is not None and for_good:
        raise UsageError("--archive keeps a copy and --for-good keeps none; name one of them")
    only_count = archive is None and not for_good
    with open_store(load_settings()) as store:
        if archive is not None:
            back_up(store.engine, archive)
            print(f"{archive}: {archive.stat().st_size} bytes")
        gone = purge(store, earliest_kept, audit.this_user(), only_count=only_count)
    counted = f"{gone.submissions} submissions, {gone.grades} grades, {gone.students} students"
    print(f"{counted} would go; --archive FILE or --for-good removes them" if only_count else f"removed: {counted}")
