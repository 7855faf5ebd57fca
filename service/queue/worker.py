"""The worker: a Celery process with spawned pool children, a sweeper, and a file that shows it is alive.

Run as ``python -m service.queue.worker``; settings come from the environment. What a task does is in ``tasks.py``.
"""

from __future__ import annotations

import fcntl
import os
import secrets
import socket
from pathlib import Path
from threading import Event, Thread
from typing import Any

import structlog
from celery import Celery, bootsteps

from responders.sandbox.manager import Sandboxes
from service.queue.celery_app import QUEUES, make_celery
from service.queue.logs import configure_logging
from service.queue.nudges import Nudger
from service.queue.tasks import WORKER_VARIABLE
from service.settings import Settings, load_settings
from service.store.engine import Store, open_store
from sim.errors import HostError, UsageError

_log = structlog.get_logger(__name__)
_ALIVE_SECONDS = 5.0


def new_worker_name() -> str:
    """A name that no other worker has: where it runs, and chance."""
    return f"{socket.gethostname()}-{secrets.token_hex(4)}"


def lock_path(settings: Settings) -> Path:
    """Locked as long as a worker of this home lives."""
    return settings.home / "run" / "worker.lock"


def alive_path(settings: Settings, name: str) -> Path:
    """Touched every few seconds as long as the worker of this name takes messages."""
    return settings.home / "run" / f"{name}.alive"


def run_worker(settings: Settings) -> int:
    """Work until told to stop; returns the exit status. ``settings.broker_url`` must name a broker.

    Raises UsageError without one, HostError when the database cannot be used or the walls round student code cannot
    be put up.
    """
    if not settings.broker_url:
        raise UsageError("a worker needs a broker: set ROBOMARK_BROKER_URL")
    with Sandboxes() as sandboxes:
        sandboxes.check()
    os.environ.update(settings.environment())
    name = os.environ.setdefault(WORKER_VARIABLE, new_worker_name())
    # A responder's arithmetic is small; threads of the linear algebra library would only fight for the cores.
    for variable in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS"):
        os.environ.setdefault(variable, "1")
    configure_logging(settings.log_level)
    alive = alive_path(settings, name)
    alive.parent.mkdir(parents=True, exist_ok=True)
    with open_store(settings) as store, lock_path(settings).open("a") as lock:
        # Shared: several workers of one home may live; whoever asks wants to know whether any does.
        fcntl.flock(lock, fcntl.LOCK_SH)
        app = make_celery(settings)
        _add_steps(app, store, settings, alive)
        arguments = ["worker", "--hostname", f"{name}@%h", "--queues", ",".join(QUEUES)]
        arguments += ["--pool", "prefork", "--without-gossip", "--without-mingle"]
        arguments += ["--loglevel", settings.log_level]
        try:
            return int(app.worker_main(arguments) or 0)
        except SystemExit as end:
            return end.code if isinstance(end.code, int) else 1
        finally:
            alive.unlink(missing_ok=True)


def worker_lives(settings: Settings) -> bool:
    """Whether a worker of this home runs now."""
    path = lock_path(settings)
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        with path.open("a") as lock:
            fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        return True
    except OSError as error:
        raise HostError(f"The lock file cannot be used: {path}: {error.strerror}") from None
    return False


def _add_steps(app: Celery, store: Store, settings: Settings, alive: Path) -> None:
    nudger = Nudger(app, store, settings)
    period = min(settings.lease_seconds / 3, 5.0)

    class Sweeper(bootsteps.StartStopStep):
        """Sweeps beside the worker's own loop, which must never wait for the database."""

        def __init__(self, parent: Any, **options: Any) -> None:
            super().__init__(parent, **options)
            self._ended = Event()
            self._thread = Thread(target=self._run, name="sweeper", daemon=True)

        def start(self, parent: Any) -> None:
            self._thread.start()

        def stop(self, parent: Any) -> None:
            self._ended.set()

        terminate = stop

        def _run(self) -> None:
            while not self._ended.wait(period):
                try:
                    nudger.sweep()
                except Exception:
                    _log.exception("sweep.failed")

    class Alive(bootsteps.StartStopStep):
        """A step of the consumer, not the worker: a worker that lost its broker for good must not look alive."""

        requires = ("celery.worker.consumer.tasks:Tasks",)

        def start(self, parent: Any) -> None:
            alive.touch()
            self._timer = parent.timer.call_repeatedly(_ALIVE_SECONDS, alive.touch)

        def stop(self, parent: Any) -> None:
            self._timer.cancel()

    app.steps["worker"].add(Sweeper)
    app.steps["consumer"].add(Alive)


if __name__ == "__main__":
    raise SystemExit(run_worker(load_settings()))
