"""The installation and the user for commands. The user acts as operator."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import TYPE_CHECKING

from service.settings import Settings, load_settings

if TYPE_CHECKING:
    from service.operations.context import Actor, Service, Store
    from service.operations.types import JobQueue
    from service.queue.notifier import Notifier


@contextmanager
def open_installation() -> Iterator[tuple[Service, Actor]]:
    """Open the installation and yield it with the command's user as operator."""
    from service.operations.context import Service, create_machine_actor, open_store

    settings = load_settings()
    with open_store(settings) as store:
        yield Service(settings, store, _LazyNotifier(settings, store)), create_machine_actor()


@dataclass(frozen=True, slots=True)
class _LazyNotifier:
    """A notifier for the workers that loads the queue only when needed.

    It does nothing if no broker is configured and no service runs in the home folder. Workers that start later find the
    waiting jobs themselves.
    """

    settings: Settings
    store: Store

    def grade(self, lane: JobQueue, count: int = 1) -> None:
        if count > 0 and (notifier := self._create_notifier()):
            notifier.grade(lane, count)

    def notify_test_runs(self, count: int = 1) -> None:
        if count > 0 and (notifier := self._create_notifier()):
            notifier.notify_test_runs(count)

    def plot(self, count: int = 1) -> None:
        if count > 0 and (notifier := self._create_notifier()):
            notifier.plot(count)

    def _create_notifier(self) -> Notifier | None:
        from service.queue.broker import build_broker_url, is_broker_responding
        from service.queue.celery_app import make_celery
        from service.queue.logs import configure_logging
        from service.queue.notifier import Notifier

        settings = self.settings
        if not settings.broker_url:
            if not is_broker_responding(settings):
                return None
            settings = settings.with_broker(build_broker_url(settings))
        configure_logging(settings.log_level)
        return Notifier(make_celery(settings), self.store, settings)
