"""Waiting for batches, with the running services or with services started for this command.

``waiting.py`` shows the progress.
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
    """Batches that are being graded while the command waits."""

    waiting: Sequence[Waiting]
    end_services: Callable[[], object]

    def for_marks(self) -> None:
        """Wait until all jobs have ended."""
        for each in self.waiting:
            each.for_marks()

    def for_plots(self) -> None:
        """Wait until all plots are drawn, then start stopping the services of this command."""
        for each in self.waiting:
            each.for_plots()
        self.end_services()


@dataclass(frozen=True, slots=True)
class NotifiedLater:
    """A notifier that does nothing, for commands that wait.

    These commands use ``Services.awaited``, which notifies the workers itself.
    """

    def grade(self, lane: Lane, count: int = 1) -> None:
        """Do nothing."""

    def try_out(self, count: int = 1) -> None:
        """Do nothing."""

    def plot(self, count: int = 1) -> None:
        """Do nothing."""


@dataclass(frozen=True, slots=True)
class Services:
    """The services that grade: those in the settings, or a broker and a worker started by this command.

    Attributes:
        settings: Settings that include the broker's address.
        ours: True if this command started the services.
        keep_up: Restarts services that stopped.
        end: Stops the services.
    """

    settings: Settings
    ours: bool
    keep_up: Callable[[], None]
    end: Callable[[], object]

    def awaited(self, service: Service, actor: Actor, batch_ids: Sequence[str], new: int) -> AwaitedBatches:
        """Notify the workers and return the batches to wait for.

        Args:
            service: The installation.
            actor: The user who waits.
            batch_ids: Ids of the batches. Finished and paused batches are skipped.
            new: Number of jobs that were just queued.

        Raises:
            HostError: Student code would run on this machine, but the sandbox cannot be set up.
        """
        unfinished = _unfinished(service, actor, batch_ids)
        if not unfinished:
            return AwaitedBatches((), _nothing)
        with Sandboxes() as sandboxes:
            if self.ours:
                sandboxes.begin("robot", ())
            # These imports run while the sandbox and the worker start.
            from service.commands.batch.waiting import Waiting
            from service.operations.types import Lane
            from service.queue.celery_app import make_celery
            from service.queue.notifier import Notifier

            if self.ours:
                # Check here to report the reason. Otherwise the user only sees that the worker stopped.
                sandboxes.check()
        notifier = Notifier(make_celery(self.settings), service.store, self.settings)
        notifier.grade(Lane.BATCH, new)
        waiting = [Waiting(service, actor, notifier, each, progress(), self.keep_up) for each in unfinished]
        return AwaitedBatches(waiting, self.end)


@contextmanager
def started(service: Service) -> Iterator[Services]:
    """Yield the services that grade. Services started here stop at the end of the ``with`` block.

    The function does not wait until the services are ready.
    """
    settings = service.settings
    if settings.broker_url:
        yield Services(settings, False, _nothing, _nothing)
        return
    with EmbeddedServices(settings, service.store) as embedded, ThreadPoolExecutor(1) as beside:
        end = partial(beside.submit, embedded.stop, _GRACE_SECONDS)
        yield Services(embedded.settings, True, embedded.ensure, end)


@contextmanager
def awaited(service: Service, actor: Actor, batch_ids: Sequence[str], new: int) -> Iterator[AwaitedBatches]:
    """Notify the workers about ``new`` queued jobs and yield the batches to wait for.

    Services started here have stopped when the ``with`` block ends.
    """
    if not _unfinished(service, actor, batch_ids):
        yield AwaitedBatches((), _nothing)
        return
    with started(service) as services:
        yield services.awaited(service, actor, batch_ids, new)


def _unfinished(service: Service, actor: Actor, batch_ids: Sequence[str]) -> list[str]:
    """Return the ids of unfinished batches. Paused batches are only reported, because they would never finish."""
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
    """Do nothing. Services that were not started by this command are managed elsewhere."""
