"""Notification of workers through the broker. Lost, duplicate or late notifications are harmless.

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

from service.queue.celery_app import (
    CAUSES,
    EXPLAIN_TASK,
    GRADE_TASK,
    PLOT_TASK,
    PLOTS,
    QUEUES,
    TEST_RUN_TASK,
    TEST_RUNS,
)
from service.settings import Settings
from service.store.engine import Store
from service.store.grades import causes, plots
from service.store.queue import test_runs
from service.store.queue.jobs import RetryPolicy
from service.store.queue.lease_reaper import count_missing_notices, mark_not_notified, mark_notified, requeue_lost_jobs
from service.store.states import JobQueue

_log = structlog.get_logger(__name__)
#: Errors raised for an unreachable broker.
_BROKER_ERRORS = (BrokerError, RedisError, OSError)


@dataclass(frozen=True, slots=True)
class Notifier:
    """Publisher of notifications, which also repeats lost ones."""

    app: Celery
    store: Store
    settings: Settings

    def grade(self, lane: JobQueue, count: int = 1) -> None:
        """Notify for ``count`` new jobs of a queue."""
        if count <= 0:
            return
        try:
            # Stored first: a claim skips a row that is being written, so an earlier notification would have no effect.
            notified_jobs = mark_notified(self.store, lane, count)
            if not self._publish(GRADE_TASK, lane.value, count):
                mark_not_notified(self.store, notified_jobs)
        except SQLAlchemyError as error:
            _log.warning("notify.failed", task=GRADE_TASK, count=count, error=str(error))

    def notify_test_runs(self, count: int = 1) -> None:
        """Notify for ``count`` test runs."""
        self._publish(TEST_RUN_TASK, TEST_RUNS, count)

    def plot(self, count: int = 1) -> None:
        """Notify for the plots of ``count`` jobs."""
        self._publish(PLOT_TASK, PLOTS, count)

    def explain(self, count: int = 1) -> None:
        """Notify for the causes of lost marks in ``count`` grades."""
        self._publish(EXPLAIN_TASK, CAUSES, count)

    def catch_up(self) -> None:
        """Requeue lost jobs, and notify for due jobs without a notification.

        Publishes at most as many notifications as there are due jobs without one in the broker, so that they do not
        accumulate while no worker runs.
        """
        requeue_lost_jobs(self.store, RetryPolicy(self.settings.backoff_seconds))
        for lane, missing_notices in count_missing_notices(self.store, self.settings.notify_seconds).items():
            self.grade(lane, min(missing_notices.stale, self._count_missing(lane.value, missing_notices.due)))
        due_runs = test_runs.count_due_runs(self.store)
        if due_runs:
            self.notify_test_runs(self._count_missing(TEST_RUNS, due_runs))
        due_plots = plots.count_due_plots(self.store)
        if due_plots:
            self.plot(self._count_missing(PLOTS, due_plots))
        unexplained_grades = causes.count_unexplained_grades(self.store) if self.settings.search_causes else 0
        if unexplained_grades:
            self.explain(self._count_missing(CAUSES, unexplained_grades))

    def waiting(self) -> int:
        """Return the number of notifications in the broker; 0 if it is unreachable."""
        return sum(self._count_messages(QUEUES) or ())

    def _count_missing(self, queue: str, due: int) -> int:
        depths = self._count_messages([queue])
        return 0 if depths is None else max(0, due - depths[0])

    def _count_messages(self, queues: Sequence[str]) -> list[int] | None:
        try:
            with self.app.connection_for_write() as connection, connection.channel() as channel:
                return [cast(Any, channel).queue_declare(queue=queue).message_count for queue in queues]
        except _BROKER_ERRORS as error:
            _log.warning("broker.unreachable", error=str(error))
            return None

    def _publish(self, task: str, queue: str, count: int) -> bool:
        if count <= 0:
            return False
        try:
            with self.app.connection_for_write() as connection, connection.Producer() as producer:
                for _ in range(count):
                    self.app.send_task(task, queue=queue, producer=producer, ignore_result=True)
        except _BROKER_ERRORS as error:
            _log.warning("notify.failed", task=task, count=count, error=str(error))
            return False
        return True
