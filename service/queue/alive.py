"""Which workers of a home live: each has a file in the run folder that is locked for as long as it does.

Starts none and ends none; what a worker does is in ``worker.py``.
"""

from __future__ import annotations

import fcntl
import os
import secrets
import socket
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from service.queue.processes import run_file
from service.settings import Settings
from service.store.engine import Store
from service.store.queue import jobs, workers
from sim.errors import HostError

#: Set by the worker for its pool children: one name for all of them, so that a dead worker's jobs can be found.
WORKER_VARIABLE = "ROBOMARK_WORKER_NAME"


def worker_name() -> str:
    """The name of the worker that this process is part of."""
    return os.environ.get(WORKER_VARIABLE) or f"{socket.gethostname()}:{os.getpid()}"


def new_worker_name() -> str:
    """A name that no other worker has: where it runs, and chance."""
    return f"{socket.gethostname()}-{secrets.token_hex(4)}"


def lock_path(settings: Settings) -> Path:
    """Locked as long as a worker of this home lives."""
    return settings.home / "run" / "worker.lock"


def alive_path(settings: Settings, name: str) -> Path:
    """Touched every few seconds as long as the worker of this name takes messages, and locked while it lives."""
    return settings.home / "run" / f"{name}.alive"


@contextmanager
def shown_alive(settings: Settings, name: str) -> Iterator[None]:
    """The worker's file in the run folder, locked as long as this process lives, however it ends."""
    path = run_file(alive_path(settings, name))
    hidden = run_file(path.with_suffix(".new"))
    with hidden.open("a") as file:
        fcntl.flock(file, fcntl.LOCK_EX)
        # Nobody sees the file without its lock.
        hidden.replace(path)
        try:
            yield
        finally:
            path.unlink(missing_ok=True)


def release_dead_workers(settings: Settings, store: Store) -> int:
    """Give back what workers of this home held that were killed and of which nobody knew. Returns how many jobs."""
    given_back = 0
    for path in sorted((settings.home / "run").glob("*.alive")):
        with suppress(OSError), run_file(path).open("a") as file:
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
            given_back += jobs.release_worker(store, path.stem)
            workers.forget(store, path.stem)
            path.unlink(missing_ok=True)
    return given_back


def worker_lives(settings: Settings) -> bool:
    """Whether a worker of this home runs now."""
    path = run_file(lock_path(settings))
    try:
        with path.open("a") as lock:
            fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        return True
    except OSError as error:
        raise HostError(f"The lock file cannot be used: {path}: {error.strerror}") from None
    return False
