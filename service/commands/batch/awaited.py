"""Waits for batches with the services that run, or with our own for as long as it takes.

What is shown of them meanwhile is ``waiting.py``'s.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING

from responders.sandbox.manager import Sandboxes
from service.commands.shown import note, progress
from service.queue.embedded import EmbeddedServices
from service.settings import Settings

if TYPE_CHECKING:
    from service.commands.batch.waiting import Waiting
    from service.operations.context import Actor, Service
    from service.operations.types import Lane

_GRACE_SECONDS = 15.0


@dataclass(frozen=True, slots=True)
class AwaitedBatches:
    """Batches that services grade meanwhile."""

    waiting: Sequence[Waiting]
    end_services: Callable[[], object]

    def for_marks(self) -> None:
        """Return when all marks are there."""
        for each in self.waiting:
            each.for_marks()

    def for_plots(self) -> None:
        """Return when all plots are there; services of our own begin to end then."""
        for each in self.waiting:
            each.for_plots()
        self.end_services()


@dataclass(frozen=True, slots=True)
class NotifiedLater:
    """No notices to workers, where the batches are awaited: ``Services.awaited`` notifies workers of its own."""

    def grade(self, lane: Lane, count: int = 1) -> None:
        """Do nothing."""

    def try_out(self, count: int = 1) -> None:
        """Do nothing."""

    def plot(self, count: int = 1) -> None:
        """Do nothing."""


@dataclass(frozen=True, slots=True)
class Services:
    """Who grades: what the settings name, or a broker and a worker of our own."""

    settings: Settings
    ours: bool
    keep_up: Callable[[], None]
    end: Callable[[], object]

    def awaited(self, service: Service, actor: Actor, batch_ids: Sequence[str], new: int) -> AwaitedBatches:
        """Batches of which ``new`` jobs were queued just now.

        Raises HostError where student code is to be run here and cannot be enclosed.
        """
        unfinished = _unfinished(service, actor, batch_ids)
        if not unfinished:
            return AwaitedBatches((), _nothing)
        with Sandboxes() as sandboxes:
            if self.ours:
                sandboxes.begin("robot", ())
            # It begins meanwhile, and so does the worker.
            from service.commands.batch.waiting import Waiting
            from service.operations.types import Lane
            from service.queue.celery_app import make_celery
            from service.queue.notifier import Notifier

            if self.ours:
                # Here the reason can be said; a worker that refuses would only be seen to end.
                sandboxes.check()
        notifier = Notifier(make_celery(self.settings), service.store, self.settings)
        notifier.grade(Lane.BATCH, new)
        waiting = [Waiting(service, actor, notifier, each, progress(), self.keep_up) for each in unfinished]
        return AwaitedBatches(waiting, self.end)


@contextmanager
def started(service: Service) -> Iterator[Services]:
    """Services that begin to start, and are waited for no more than they must be; ours end with the ``with``."""
    settings = service.settings
    if settings.broker_url:
        yield Services(settings, False, _nothing, _nothing)
        return
    with EmbeddedServices(settings, service.store) as embedded, ThreadPoolExecutor(1) as beside:
        end = partial(beside.submit, embedded.stop, _GRACE_SECONDS)
        yield Services(embedded.settings, True, embedded.ensure, end)


@contextmanager
def awaited(service: Service, actor: Actor, batch_ids: Sequence[str], new: int) -> Iterator[AwaitedBatches]:
    """Batches of which ``new`` jobs were queued just now; services of our own have ended when the ``with`` ends."""
    if not _unfinished(service, actor, batch_ids):
        yield AwaitedBatches((), _nothing)
        return
    with started(service) as services:
        yield services.awaited(service, actor, batch_ids, new)


def _unfinished(service: Service, actor: Actor, batch_ids: Sequence[str]) -> list[str]:
    """The batches to wait for; one that is paused would keep its waiter for ever, and is only named."""
    from service.operations.batch_views import look
    from service.operations.types import BatchState

    unfinished = []
    for batch_id in dict.fromkeys(batch_ids):
        far, state = look(service, actor, batch_id)
        if far.ended == far.jobs and not far.plots_due:
            continue
        if state is BatchState.OPEN:
            unfinished.append(batch_id)
        else:
            note(f"batch {batch_id} is paused: robomark batch resume {batch_id}")
    return unfinished


def _nothing() -> None:
    """Services that are not ours are kept up, and ended, by others."""
