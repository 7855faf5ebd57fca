"""Supervisor of a whole service on one machine: broker, workers and web server, each restarted when it ends.

Contains no loop and prints nothing; ``commands/up.py`` does.
"""

from __future__ import annotations

import fcntl
import os
import socket
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from types import TracebackType
from typing import Self

from service.home import open_home
from service.queue.broker import EmbeddedBroker
from service.queue.live_workers import release_dead_workers
from service.queue.processes import prepare_run_file
from service.queue.supervised_processes import SupervisedProcess, SupervisedWorker, stop_processes
from service.settings import Settings
from service.store.engine import Store
from sim.errors import HostError, UsageError
from sim.processes import build_python_command

_GRACE_SECONDS = 5.0
_SHORT_LIVES = 3


class Supervisor:
    """Broker (unless configured externally), workers, and a web server on a listening socket (unless None)."""

    def __init__(self, settings: Settings, store: Store, workers: int, web_socket: socket.socket | None) -> None:
        self._store = store
        self._broker = None if settings.broker_url else EmbeddedBroker(settings)
        self.settings = settings if self._broker is None else self._broker.settings
        logs = settings.home / "log"
        names = ["worker", *(f"worker-{number}" for number in range(2, workers + 1))]
        self.workers = [SupervisedWorker(self.settings, store, logs / f"{name}.log") for name in names]
        self._web = [] if web_socket is None else [_build_web_server(self.settings, web_socket)]

    @property
    def is_ready(self) -> bool:
        """Return whether every worker looks for jobs."""
        return all(worker.takes_messages for worker in self.workers)

    def ensure(self) -> None:
        """Start missing processes. Raises HostError if the broker cannot be started."""
        if self._broker is not None:
            self._broker.ensure()
        for worker in self.workers:
            worker.ensure()
            worker.process.truncate_log_file()
        for web_server in self._web:
            web_server.detect_end()
            web_server.start({})
            web_server.truncate_log_file()

    def describe_short_lived_process(self) -> str | None:
        """Return a sentence about a process that repeatedly ends right after its start; None if there is none."""
        for process in [*(worker.process for worker in self.workers), *self._web]:
            if process.short_lives >= _SHORT_LIVES:
                return f"a process stops immediately after its start; see {process.log}"
        return None

    def stop(self) -> int:
        """Stop everything that was started here. Returns the number of requeued jobs."""
        stop_processes([*(worker.process for worker in self.workers), *self._web], _GRACE_SECONDS)
        job_count = sum(worker.release_jobs() for worker in self.workers)
        if self._broker is not None:
            self._broker.stop()
        return job_count

    def __enter__(self) -> Self:
        release_dead_workers(self.settings, self._store)
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.stop()


@contextmanager
def locked_home(settings: Settings) -> Iterator[Callable[[str], None]]:
    """Lock a home for a single service. Yields a function that stores a note for other processes.

    Raises UsageError, with the note, if the home is locked. The lock is released when this process ends for any reason.
    """
    open_home(settings.home)
    path = prepare_run_file(settings.home / "run" / "up.lock")
    try:
        with path.open("a+") as lock:
            try:
                fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
            except BlockingIOError:
                lock.seek(0)
                note_text = " ".join(lock.read(400).split())
                raise UsageError(f"robomark is already running in {settings.home} ({note_text})") from None

            def leave(note: str) -> None:
                lock.truncate(0)
                lock.write(f"process {os.getpid()}{note}")
                lock.flush()

            leave("")
            yield leave
    except OSError as error:
        raise HostError(f"{path} cannot be used: {error.strerror}") from None


def _build_web_server(settings: Settings, web_socket: socket.socket) -> SupervisedProcess:
    number = web_socket.fileno()
    command = build_python_command("-m", "service.web.server", str(number))
    return SupervisedProcess(command, settings.to_environment(), settings.home / "log" / "web.log", [number])
