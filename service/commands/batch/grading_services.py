"""Waiting for batches, with the running services or with services started for this command.

``batch_waiter.py`` shows the progress.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING

from responders.sandbox.manager import Sandboxes
from service.commands.output import create_progress_console, print_note
from service.queue.embedded_services import EmbeddedServices
from service.settings import Settings

if TYPE_CHECKING:
    from service.commands.batch.batch_waiter import BatchWaiter
    from service.operations.context import Actor, Service
    from service.operations.types import JobQueue

_GRACE_SECONDS = 15.0


@dataclass(frozen=True, slots=True)
class PendingBatches:
    """Batches that are being graded while the command waits."""

    waiters: Sequence[BatchWaiter]
    stop_services: Callable[[], object]

    def wait_for_marks(self) -> None:
        """Wait until all jobs have ended."""
        for waiter in self.waiters:
            waiter.wait_for_marks()

    def wait_for_plots(self) -> None:
        """Wait until all plots are drawn, then start stopping the services of this command."""
        for waiter in self.waiters:
            waiter.wait_for_plots()
        self.stop_services()


@dataclass(frozen=True, slots=True)
class NullNotifier:
    """A notifier that does nothing, for commands that wait.

    These commands use ``GradingServices``, which notifies the workers itself.
    """

    def grade(self, lane: JobQueue, count: int = 1) -> None:
        """Do nothing."""

    def notify_test_runs(self, count: int = 1) -> None:
        """Do nothing."""

    def plot(self, count: int = 1) -> None:
        """Do nothing."""


@dataclass(frozen=True, slots=True)
class GradingServices:
    """The services that grade: those in the settings, or a broker and a worker started by this command.

    Attributes:
        settings: Settings that include the broker's address.
        is_own: Whether this command started the services.
        restart_stopped: Restarts services that stopped.
        stop: Stops the services.
    """

    settings: Settings
    is_own: bool
    restart_stopped: Callable[[], None]
    stop: Callable[[], object]

    def notify_workers(
        self, service: Service, actor: Actor, batch_ids: Sequence[str], queued_count: int
    ) -> PendingBatches:
        """Notify the workers and return the batches to wait for.

        Args:
            service: The installation.
            actor: The user who waits.
            batch_ids: Ids of the batches. Finished and paused batches are skipped.
            queued_count: Number of jobs that were just queued.

        Raises:
            HostError: Student code would run on this machine, but the sandbox cannot be set up.
        """
        unfinished = _list_unfinished(service, actor, batch_ids)
        if not unfinished:
            return PendingBatches((), _do_nothing)
        with Sandboxes() as sandboxes:
            if self.is_own:
                sandboxes.begin("robot", ())
            # These imports run while the sandbox and the worker start.
            from service.commands.batch.batch_waiter import BatchWaiter
            from service.operations.types import JobQueue
            from service.queue.celery_app import make_celery
            from service.queue.notifier import Notifier

            if self.is_own:
                # Check here to report the reason. Otherwise the user only sees that the worker stopped.
                sandboxes.check_isolation()
        notifier = Notifier(make_celery(self.settings), service.store, self.settings)
        notifier.grade(JobQueue.BATCH, queued_count)
        waiters = [
            BatchWaiter(service, actor, notifier, each, create_progress_console(), self.restart_stopped)
            for each in unfinished
        ]
        return PendingBatches(waiters, self.stop)


@contextmanager
def grading_services(service: Service) -> Iterator[GradingServices]:
    """Yield the services that grade. Services started here stop at the end of the ``with`` block.

    The function does not wait until the services are ready.
    """
    settings = service.settings
    if settings.broker_url:
        yield GradingServices(settings, False, _do_nothing, _do_nothing)
        return
    with EmbeddedServices(settings, service.store) as embedded, ThreadPoolExecutor(1) as executor:
        stop = partial(executor.submit, embedded.stop, _GRACE_SECONDS)
        yield GradingServices(embedded.settings, True, embedded.ensure, stop)


@contextmanager
def pending_batches(
    service: Service, actor: Actor, batch_ids: Sequence[str], queued_count: int
) -> Iterator[PendingBatches]:
    """Notify the workers about ``queued_count`` queued jobs and yield the batches to wait for.

    Services started here have stopped when the ``with`` block ends.
    """
    if not _list_unfinished(service, actor, batch_ids):
        yield PendingBatches((), _do_nothing)
        return
    with grading_services(service) as services:
        yield services.notify_workers(service, actor, batch_ids, queued_count)


def _list_unfinished(service: Service, actor: Actor, batch_ids: Sequence[str]) -> list[str]:
    """Return the ids of unfinished batches. Paused batches are only reported, because they would never finish."""
    from service.operations.batch_views import poll_progress
    from service.operations.types import BatchState

    unfinished = []
    for batch_id in dict.fromkeys(batch_ids):
        progress, state = poll_progress(service, actor, batch_id)
        if progress.ended == progress.jobs and not progress.plots_due:
            continue
        if state is BatchState.OPEN:
            unfinished.append(batch_id)
        else:
            print_note(f"batch {batch_id} is paused: robomark batch resume {batch_id}")
    return unfinished


def _do_nothing() -> None:
    """Do nothing. Services that were not started by this command are managed elsewhere."""
