"""The installation and the user for commands. The user acts as operator."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import TYPE_CHECKING

from service.settings import Settings, load_settings

if TYPE_CHECKING:
    from service.operations.context import Actor, Service, Store
    from service.operations.types import Lane
    from service.queue.notifier import Notifier


@contextmanager
def operating() -> Iterator[tuple[Service, Actor]]:
    """Open the installation and yield it with the command's user as operator."""
    from service.operations.context import Service, machine_operator, open_store

    settings = load_settings()
    with open_store(settings) as store:
        yield Service(settings, store, _LateNotifier(settings, store)), machine_operator()


@dataclass(frozen=True, slots=True)
class _LateNotifier:
    """A notifier for the workers that loads the queue only when needed.

    It does nothing if no broker is configured and no service runs in the home folder. Workers that start later find the
    waiting jobs themselves.
    """

    settings: Settings
    store: Store

    def grade(self, lane: Lane, count: int = 1) -> None:
        if count > 0 and (notifier := self._notifier()):
            notifier.grade(lane, count)

    def try_out(self, count: int = 1) -> None:
        if count > 0 and (notifier := self._notifier()):
            notifier.try_out(count)

    def plot(self, count: int = 1) -> None:
        if count > 0 and (notifier := self._notifier()):
            notifier.plot(count)

    def _notifier(self) -> Notifier | None:
        from service.queue.broker import broker_answers, broker_url
        from service.queue.celery_app import make_celery
        from service.queue.logs import configure_logging
        from service.queue.notifier import Notifier

        settings = self.settings
        if not settings.broker_url:
            if not broker_answers(settings):
                return None
            settings = settings.with_broker(broker_url(settings))
        configure_logging(settings.log_level)
        return Notifier(make_celery(settings), self.store, settings)
