"""Embedded services: the bundled broker and one worker process, started and stopped with this process.

Equivalent to a separate Redis and ``robomark worker``, without starting them manually.
"""

from __future__ import annotations

from types import TracebackType
from typing import Self

from service.queue.broker import EmbeddedBroker
from service.queue.live_workers import is_worker_running, release_dead_workers
from service.queue.supervised_processes import SupervisedWorker
from service.settings import Settings
from service.store.engine import Store
from sim.errors import HostError

_SHORT_LIVES = 3


class EmbeddedServices:
    """Broker and worker for the duration of a ``with`` block; services that already run in this home are reused."""

    def __init__(self, settings: Settings, store: Store) -> None:
        self._broker = EmbeddedBroker(settings)
        self.settings = self._broker.settings
        self._store = store
        self._worker = SupervisedWorker(self.settings, store, settings.home / "log" / "worker.log")

    def ensure(self) -> None:
        """Start missing services. Raises HostError if one cannot be started."""
        if self._worker.process.short_lives >= _SHORT_LIVES:
            log = self._worker.process.log
            raise HostError(f"the worker stops immediately after its start; see {log}")
        if self._worker.process.pid is not None or not is_worker_running(self.settings):
            self._worker.ensure()
        # It responds long before the worker needs it.
        self._broker.ensure()

    def stop(self, grace_seconds: float) -> None:
        """Stop the services started here; unfinished jobs are requeued after ``grace_seconds``."""
        self._worker.stop(grace_seconds)
        self._broker.stop()

    @property
    def worker_pid(self) -> int | None:
        """The process id of the worker that was started here."""
        return self._worker.process.pid

    def __enter__(self) -> Self:
        try:
            release_dead_workers(self.settings, self._store)
            self.ensure()
        except BaseException:
            self.stop(0)
            raise
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.stop(grace_seconds=15 if kind is None else 1)
