"""``robomark db``: upgrade the tables, back up, restore, and remove old data.

``store/backup.py`` and ``store/purge.py`` define which data is copied or removed.
"""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from service.commands.installation import open_installation
from service.commands.output import print_json, print_line
from service.commands.privacy import remove_or_count
from service.operations import database
from service.settings import load_settings
from sim.errors import UsageError
from submissions.roster import parse_time


def upgrade_tables() -> None:
    """Upgrade the tables to this release. Every command does this when it starts."""
    revision = database.upgrade(load_settings())
    print_json(revision=revision)
    print_line(f"the database is at revision {revision}")


def backup_database(
    file: Annotated[Path, typer.Argument(help="The backup file to create. It must not exist yet.")],
) -> None:
    """Back up the database while it is in use, to a SQLite file that only you can read."""
    size = database.back_up(load_settings(), file)
    print_json(file=file, bytes=size)
    print_line(f"{file}: {size} bytes")


def restore_database(file: Annotated[Path, typer.Argument(help="A file created by db backup.")]) -> None:
    """Restore a backup into a database without submissions, SQLite or PostgreSQL."""
    with open_installation() as (service, actor):
        database_name = database.restore(service, actor, file)
    print_json(database=database_name, file=file)
    print_line(f"{database_name} restored from {file}")


def purge_database(
    before: Annotated[str, typer.Option(help="A date, or a date and time, such as 2025-09-01.")],
    archive: Annotated[Path | None, typer.Option(help="Back up the whole database to this file first.")] = None,
    for_good: Annotated[bool, typer.Option("--for-good", help="Do not create a backup.")] = False,
) -> None:
    """Remove submissions before a date, with their grades and recordings, and students without other submissions.

    Without --archive or --for-good, show how much would be removed.
    """
    try:
        earliest_time = parse_time(before)
    except ValueError:
        raise UsageError(f"--before {before}: expected a date like 2025-09-01") from None
    remove_or_count(
        archive,
        for_good,
        lambda service, actor, only_count: database.remove_old_submissions(
            service, actor, earliest_time, only_count=only_count
        ),
    )
