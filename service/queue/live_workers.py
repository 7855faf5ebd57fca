"""Live workers of a home: each has a file in the run folder that it locks until it ends.

Starts and ends no workers; ``worker.py`` contains the worker.
"""

from __future__ import annotations

import fcntl
import os
import secrets
import socket
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from service.queue.processes import prepare_run_file
from service.settings import Settings
from service.store.engine import Store
from service.store.queue import jobs, workers
from sim.errors import HostError

#: Set by the worker for its pool children, which share one name, so that a dead worker's jobs can be found.
WORKER_VARIABLE = "ROBOMARK_WORKER_NAME"


def read_worker_name() -> str:
    """Return the name of the worker that this process belongs to."""
    return os.environ.get(WORKER_VARIABLE) or f"{socket.gethostname()}:{os.getpid()}"


def create_worker_name() -> str:
    """Return a unique name for a worker: the host name and a random suffix."""
    return f"{socket.gethostname()}-{secrets.token_hex(4)}"


def build_lock_path(settings: Settings) -> Path:
    """Return the lock file that a worker of this home locks until it ends."""
    return settings.home / "run" / "worker.lock"


def build_heartbeat_path(settings: Settings, name: str) -> Path:
    """Return the file that this worker touches every few seconds while it takes messages, and locks until it ends."""
    return settings.home / "run" / f"{name}.alive"


@contextmanager
def locked_heartbeat_file(settings: Settings, name: str) -> Iterator[None]:
    """Create the worker's file in the run folder, locked until this process ends for any reason."""
    path = prepare_run_file(build_heartbeat_path(settings, name))
    new_path = prepare_run_file(path.with_suffix(".new"))
    with new_path.open("a") as file:
        fcntl.flock(file, fcntl.LOCK_EX)
        # The file appears only with its lock.
        new_path.replace(path)
        try:
            yield
        finally:
            path.unlink(missing_ok=True)


def release_dead_workers(settings: Settings, store: Store) -> int:
    """Requeue the jobs of killed workers of this home. Returns their number."""
    job_count = 0
    for path in sorted((settings.home / "run").glob("*.alive")):
        with suppress(OSError), prepare_run_file(path).open("a") as file:
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
            job_count += jobs.release_worker(store, path.stem)
            workers.delete_heartbeat(store, path.stem)
            path.unlink(missing_ok=True)
    return job_count


def is_worker_running(settings: Settings) -> bool:
    """Return whether a worker of this home is running."""
    path = prepare_run_file(build_lock_path(settings))
    try:
        with path.open("a") as lock:
            fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        return True
    except OSError as error:
        raise HostError(f"The lock file cannot be used: {path}: {error.strerror}") from None
    return False
