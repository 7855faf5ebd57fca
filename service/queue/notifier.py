"""Tells workers through the broker that there is work. A notice that is lost, doubled or late does no harm.

No notice fails when the broker or the database does, as what it is about is committed already: the lease reaper
notifies again.
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
#: What a broker that is not there can raise.
_AWAY = (BrokerError, RedisError, OSError)


@dataclass(frozen=True, slots=True)
class Notifier:
    """Publishes notices, and catches up on those that were lost."""

    app: Celery
    store: Store
    settings: Settings

    def grade(self, lane: Lane, count: int = 1) -> None:
        """Notify for ``count`` jobs of a lane that were just taken in."""
        if count <= 0:
            return
        try:
            # Noted first: a claim passes over a row that is being written to, and the notice would be for nothing.
            noted = note_notices(self.store, lane, count)
            if not self._publish(GRADE_TASK, lane.value, count):
                forget_notices(self.store, noted)
        except SQLAlchemyError as error:
            _log.warning("notify.failed", task=GRADE_TASK, count=count, error=str(error))

    def try_out(self, count: int = 1) -> None:
        """Notify for ``count`` programs that students try."""
        self._publish(TRYOUT_TASK, TRYOUTS, count)

    def plot(self, count: int = 1) -> None:
        """Notify for the plots of ``count`` jobs."""
        self._publish(PLOT_TASK, PLOTS, count)

    def catch_up(self) -> None:
        """Take back lost jobs, and notice for what is due and not notified for.

        No more notices are published than there are due jobs without one in the broker's queue, so that a day
        without a worker leaves no heap of them.
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
        """How many notices lie in the broker; 0 when it is away."""
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
