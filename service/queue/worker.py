"""The worker: a Celery process with spawned pool children, a sweeper, and a file that shows it is alive.

Run as ``python -m service.queue.worker``; settings come from the environment. What a task does is in ``tasks.py``.
"""

from __future__ import annotations

import fcntl
import os
import secrets
import socket
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

import structlog
from sqlalchemy.exc import DBAPIError

from responders.sandbox import control_group
from responders.sandbox.manager import Sandboxes
from responders.sandbox.zygote import FULL, NONE
from service.home import keep_private, open_home
from service.queue.celery_app import NO_SANDBOX, QUEUES, make_celery
from service.queue.logs import configure_logging
from service.queue.processes import run_file
from service.queue.tasks import WORKER_VARIABLE
from service.queue.worker_steps import add_steps
from service.settings import Settings, load_settings
from service.store import jobs, workers
from service.store.engine import Store, open_store
from service.store.workers import WorkerDescription
from service.version import GRADER_VERSION
from sim.errors import HostError, UsageError

_log = structlog.get_logger(__name__)
#: The exit status of a worker that graded the known answer wrongly.
QUARANTINED = 3


def new_worker_name() -> str:
    """A name that no other worker has: where it runs, and chance."""
    return f"{socket.gethostname()}-{secrets.token_hex(4)}"


def lock_path(settings: Settings) -> Path:
    """Locked as long as a worker of this home lives."""
    return settings.home / "run" / "worker.lock"


def alive_path(settings: Settings, name: str) -> Path:
    """Touched every few seconds as long as the worker of this name takes messages, and locked while it lives."""
    return settings.home / "run" / f"{name}.alive"


def run_worker(settings: Settings, *, unsafe: bool = False) -> int:
    """Work until told to stop; returns the exit status. ``settings.broker_url`` must name a broker.

    ``unsafe`` does without the sandbox; every grade says so.

    Raises UsageError without one, HostError when the database cannot be used or the sandbox round student code cannot
    be put up.
    """
    if not settings.broker_url:
        raise UsageError("a worker needs a broker: set ROBOMARK_BROKER_URL")
    open_home(settings.home)
    undivided = control_group.divide()
    group = None if unsafe else control_group.for_this_process(settings.slot_memory_mb)
    with Sandboxes(NONE if unsafe else FULL, group) as sandboxes:
        sandbox = sandboxes.check()
    os.environ.update(settings.environment())
    name = os.environ.setdefault(WORKER_VARIABLE, new_worker_name())
    # A responder's arithmetic is small; threads of the linear algebra library would only fight for the cores.
    for variable in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS"):
        os.environ.setdefault(variable, "1")
    configure_logging(settings.log_level)
    _log.info("worker.control_group", not_used_because=undivided)
    with open_store(settings) as store, run_file(lock_path(settings)).open("a") as lock, _shown_alive(settings, name):
        # Shared: several workers of one home may live; whoever asks wants to know whether any does.
        fcntl.flock(lock, fcntl.LOCK_SH)
        app = make_celery(settings)
        app.conf[NO_SANDBOX] = unsafe
        described = WorkerDescription(name, socket.gethostname(), settings.concurrency, GRADER_VERSION, sandbox)
        add_steps(app, store, settings, described, alive_path(settings, name))
        arguments = ["worker", "--hostname", f"{name}@%h", "--queues", ",".join(QUEUES)]
        arguments += ["--pool", "prefork", "--without-gossip", "--without-mingle"]
        arguments += ["--loglevel", settings.log_level]
        try:
            status = int(app.worker_main(arguments) or 0)
        except SystemExit as end:
            status = end.code if isinstance(end.code, int) else 1
        finally:
            # However it was told to end, nobody waits for the lease of what it did not finish.
            _give_back(store, name)
        with suppress(DBAPIError):
            status = QUARANTINED if _in_quarantine(store, name) else status
        return status


def _in_quarantine(store: Store, name: str) -> bool:
    with store.reading() as session:
        return workers.is_in_quarantine(session, name)


@contextmanager
def _shown_alive(settings: Settings, name: str) -> Iterator[None]:
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


def _give_back(store: Store, name: str) -> None:
    try:
        jobs.release_worker(store, name)
        workers.forget(store, name)
    except DBAPIError as error:
        _log.warning("worker.not_given_back", error=str(error))


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


if __name__ == "__main__":
    keep_private()
    raise SystemExit(run_worker(load_settings()))
