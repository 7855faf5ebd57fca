"""The secret of this home, for commands that otherwise need no database: read directly if it exists.

``submissions.seeds`` uses the secret; the migrations of ``service.store`` create it.
"""

from __future__ import annotations

import sqlite3
from contextlib import closing
from pathlib import Path

from service.settings import Settings
from sim.errors import HostError
from submissions.seeds import Secret


def load_home_secret(settings: Settings) -> Secret:
    """Return the secret of the environment, otherwise that of the database, creating it if necessary.

    Raises HostError if it can be neither read nor stored.
    """
    return settings.own_secret or _read_sqlite_secret(settings) or _load_store_secret(settings)


def _read_sqlite_secret(settings: Settings) -> Secret | None:
    """Read the secret of a SQLite file; None if there is none yet."""
    file = Path(settings.database.removeprefix("sqlite:///"))
    if not file.is_file():
        return None
    try:
        with closing(sqlite3.connect(file)) as connection:
            row = connection.execute("SELECT secret FROM installation").fetchone()
    except sqlite3.Error:
        return None
    return None if row is None else Secret(row[0])


def _load_store_secret(settings: Settings) -> Secret:
    # Imported here, because this takes as long as a short grading.
    from service.store.engine import open_store
    from service.store.installation import load_secret

    try:
        with open_store(settings) as store:
            return load_secret(store)
    except HostError as error:
        raise HostError(
            f"The secret for trials cannot be saved: {error}. Set ROBOMARK_HOME to a writable folder, or "
            "ROBOMARK_SECRET."
        ) from None
