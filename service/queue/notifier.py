"""Notification of workers through the broker. Lost, duplicate or late notifications do no harm.

An unreachable broker or database does not make a notification fail, because its change is already committed: the lease
reaper notifies again.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, cast

import structlog
from celery import Celery
from kombu.exceptions import OperationalError as BrokerError
from redis.exceptions import RedisError
from sqlalchemy.exc import SQLAlchemyError

from service.queue.celery_app import GRADE_TASK, PLOT_TASK, PLOTS, QUEUES, TRYOUT_TASK, TRYOUTS
from service.settings import Settings
from service.store.engine import Store
from service.store.grades import plots
from service.store.queue import tryouts
from service.store.queue.jobs import Retry
from service.store.queue.lease_reaper import forget_notices, note_notices, requeue_lost, wanting_notices
from service.store.states import Lane

_log = structlog.get_logger(__name__)
#: Errors raised for an unreachable broker.
_AWAY = (BrokerError, RedisError, OSError)


@dataclass(frozen=True, slots=True)
class Notifier:
    """Publisher of notifications, which also repeats lost ones."""

    app: Celery
    store: Store
    settings: Settings

    def grade(self, lane: Lane, count: int = 1) -> None:
        """Notify for ``count`` new jobs of a queue."""
        if count <= 0:
            return
        try:
            # Stored first: a claim skips a row that is being written, so an earlier notification would have no effect.
            noted = note_notices(self.store, lane, count)
            if not self._publish(GRADE_TASK, lane.value, count):
                forget_notices(self.store, noted)
        except SQLAlchemyError as error:
            _log.warning("notify.failed", task=GRADE_TASK, count=count, error=str(error))

    def try_out(self, count: int = 1) -> None:
        """Notify for ``count`` test runs."""
        self._publish(TRYOUT_TASK, TRYOUTS, count)

    def plot(self, count: int = 1) -> None:
        """Notify for the plots of ``count`` jobs."""
        self._publish(PLOT_TASK, PLOTS, count)

    def catch_up(self) -> None:
        """Requeue lost jobs, and notify for due jobs without a notification.

        Publishes at most as many notifications as there are due jobs without one in the broker, so that they do not
        accumulate while no worker runs.
        """
        requeue_lost(self.store, Retry(self.settings.backoff_seconds))
        for lane, wanting in wanting_notices(self.store, self.settings.notify_seconds).items():
            self.grade(lane, min(wanting.stale, self._lacking(lane.value, wanting.due)))
        tried = tryouts.due(self.store)
        if tried:
            self.try_out(self._lacking(TRYOUTS, tried))
        waiting = plots.due(self.store)
        if waiting:
            self.plot(self._lacking(PLOTS, waiting))

    def waiting(self) -> int:
        """Return the number of notifications in the broker; 0 if it is unreachable."""
        return sum(self._depths(QUEUES) or ())

    def _lacking(self, queue: str, due: int) -> int:
        depths = self._depths([queue])
        return 0 if depths is None else max(0, due - depths[0])

    def _depths(self, queues: Sequence[str]) -> list[int] | None:
        try:
            with self.app.connection_for_write() as connection, connection.channel() as channel:
                return [cast(Any, channel).queue_declare(queue=queue).message_count for queue in queues]
        except _AWAY as error:
            _log.warning("broker.unreachable", error=str(error))
            return None

    def _publish(self, task: str, queue: str, count: int) -> bool:
        if count <= 0:
            return False
        try:
            with self.app.connection_for_write() as connection, connection.Producer() as producer:
                for _ in range(count):
                    self.app.send_task(task, queue=queue, producer=producer, ignore_result=True)
        except _AWAY as error:
            _log.warning("notify.failed", task=task, count=count, error=str(error))
            return False
        return True
