"""Waits for batches with the services that run, or with our own for as long as it takes.

What is shown of them meanwhile is ``waiting.py``'s.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import ExitStack, contextmanager

from responders.sandbox.manager import Sandboxes
from service.commands.batch.waiting import Waiting
from service.commands.shown import note, progress
from service.queue.celery_app import make_celery
from service.queue.embedded import EmbeddedServices
from service.queue.notifier import Notifier
from service.settings import Settings
from service.store import batches
from service.store.engine import Store
from service.store.states import BatchState, Lane


@contextmanager
def marks_awaited(store: Store, settings: Settings, batch_ids: Sequence[str], new: int) -> Iterator[None]:
    """All marks are there when the ``with`` begins, all plots when it ends; ``new`` jobs were queued just now."""
    unfinished = _unfinished(store, batch_ids)
    if not unfinished:
        yield
        return
    with ExitStack() as services:
        if settings.broker_url:
            broker, keep_up = settings, _nothing
        else:
            with Sandboxes() as sandboxes:
                # Here the reason can be said; a worker that refuses would only be seen to end.
                sandboxes.check()
            embedded = services.enter_context(EmbeddedServices(settings, store))
            broker, keep_up = embedded.settings, embedded.ensure
        notifier = Notifier(make_celery(broker), store, broker)
        notifier.grade(Lane.BATCH, new)
        waiting = [Waiting(store, notifier, batch_id, progress(), keep_up) for batch_id in unfinished]
        for each in waiting:
            each.for_marks()
        yield
        for each in waiting:
            each.for_plots()


def _unfinished(store: Store, batch_ids: Sequence[str]) -> list[str]:
    """The batches to wait for; one that is paused would keep its waiter for ever, and is only named."""
    unfinished = []
    with store.reading() as session:
        for batch_id in dict.fromkeys(batch_ids):
            far = batches.progress(session, batch_id)
            if far.ended == far.jobs and not far.plots_due:
                continue
            if batches.batch(session, batch_id).state is BatchState.OPEN:
                unfinished.append(batch_id)
            else:
                note(f"batch {batch_id} is paused: robomark batch resume {batch_id}")
    return unfinished


def _nothing() -> None:
    """Services that are not ours are kept up by others."""
