"""The worker: a Celery process with spawned pool children, a sweeper and a heartbeat file.

Run as ``python -m service.queue.worker``; settings come from the environment. ``tasks.py`` contains the tasks.
"""

from __future__ import annotations

import fcntl
import gc
import logging
import os
import socket
from contextlib import suppress
from typing import NoReturn

import structlog
from sqlalchemy.exc import DBAPIError

from responders.sandbox import control_group
from responders.sandbox.isolation import FULL_ISOLATION, NO_ISOLATION
from responders.sandbox.manager import Sandboxes
from service.home import keep_files_private, open_home
from service.queue.celery_app import NO_SANDBOX, QUEUES, make_celery
from service.queue.live_workers import (
    WORKER_VARIABLE,
    build_heartbeat_path,
    build_lock_path,
    create_worker_name,
    locked_heartbeat_file,
)
from service.queue.logs import configure_logging
from service.queue.processes import prepare_run_file
from service.queue.worker_steps import add_steps
from service.settings import Settings, load_settings
from service.store.engine import Store, open_store
from service.store.queue import jobs, workers
from service.store.queue.workers import WorkerDescription
from service.version import GRADER_VERSION
from sim.errors import UsageError
from sim.processes import leave_current_folder

_log = structlog.get_logger(__name__)
#: Exit status of a worker that failed a self-test.
QUARANTINED_STATUS = 3


def run_worker(settings: Settings, *, is_unsafe: bool = False) -> int:
    """Work until stopped. Returns the exit status. ``settings.broker_url`` must be set.

    ``is_unsafe`` disables the sandbox, which every grade records. Raises UsageError without a broker, HostError if the
    database is not usable or the sandbox for student code cannot be created.
    """
    if not settings.broker_url:
        raise UsageError("a worker needs a broker: set ROBOMARK_BROKER_URL")
    open_home(settings.home)
    leave_current_folder()
    obstacle = control_group.divide_group()
    group = None if is_unsafe else control_group.create_slot_group(settings.slot_memory_mb)
    configure_logging(settings.log_level)
    _log.info("worker.control_group", not_used_because=obstacle)
    with Sandboxes(NO_ISOLATION if is_unsafe else FULL_ISOLATION, group) as sandboxes:
        sandboxes.begin("robot", ())
        app = make_celery(settings)
        app.conf[NO_SANDBOX] = is_unsafe
        app.finalize()
        # Celery's worker. The sandbox is checked after this import, so that the zygote can start meanwhile.
        celery_worker = app.Worker
        sandbox = sandboxes.check_isolation()
    os.environ.update(settings.to_environment())
    name = os.environ.setdefault(WORKER_VARIABLE, create_worker_name())
    # A responder's arithmetic is small; threads of the linear algebra library would only compete for the cores.
    for variable in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS"):
        os.environ.setdefault(variable, "1")
    with (
        open_store(settings) as store,
        prepare_run_file(build_lock_path(settings)).open("a") as lock,
        locked_heartbeat_file(settings, name),
    ):
        # A shared lock: a home can have several workers, and others only check whether any is alive.
        fcntl.flock(lock, fcntl.LOCK_SH)
        description = WorkerDescription(name, socket.gethostname(), settings.concurrency, GRADER_VERSION, sandbox)
        add_steps(app, store, settings, description, build_heartbeat_path(settings, name))
        try:
            # Celery's command line would load all of its other commands first.
            worker = celery_worker(
                hostname=f"{name}@{description.host}",
                pool_cls="prefork",
                queues=QUEUES,
                loglevel=logging.getLevelNamesMapping()[settings.log_level],
                without_gossip=True,
                without_mingle=True,
                quiet=True,
            )
            worker.start()
            status = int(worker.exitcode or 0)
        except SystemExit as end:
            status = end.code if isinstance(end.code, int) else 1
        finally:
            # Requeue unfinished jobs after any kind of stop, so that they do not wait for their leases.
            _release_jobs(store, name)
        with suppress(DBAPIError):
            status = QUARANTINED_STATUS if _is_in_quarantine(store, name) else status
        return status


def _is_in_quarantine(store: Store, name: str) -> bool:
    with store.reading() as session:
        return workers.is_in_quarantine(session, name)


def _release_jobs(store: Store, name: str) -> None:
    try:
        jobs.release_worker(store, name)
        workers.delete_heartbeat(store, name)
    except DBAPIError as error:
        _log.warning("worker.not_given_back", error=str(error))


def main() -> NoReturn:
    """Run a worker with the settings of the environment."""
    keep_files_private()
    # Imported objects are permanent, so the collector skips them during work and at exit.
    gc.freeze()
    gc.enable()
    status = run_worker(load_settings())
    gc.freeze()
    raise SystemExit(status)


if __name__ == "__main__":
    main()
