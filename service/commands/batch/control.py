"""``robomark batch pause``, ``resume``, ``cancel`` and ``retry``: each says in one sentence what it changed.

What they do stands in ``store/batch_control.py``.
"""

from __future__ import annotations

from typing import Annotated

import typer

from service.commands.shown import document, tell
from service.settings import load_settings
from service.store import audit
from service.store.batches import batches
from service.store.engine import Store, open_store
from service.store.queue import batch_control
from sim.errors import UsageError

BatchId = Annotated[str, typer.Argument(help="The batch's id, or the beginning of it.")]


def pause(batch: BatchId) -> None:
    """Begin no more of a batch; what is being graded is graded to its end."""
    with open_store(load_settings()) as store:
        batch_id = _find(store, batch)
        held = batch_control.pause(store, batch_id, actor=audit.this_user())
    was = "is paused" if held.changed else "was paused already"
    document(batch=batch_id, changed=held.changed, waiting=held.waiting, running=held.running)
    tell(f"batch {batch_id} {was}: {held.waiting} waiting, {held.running} graded to their end")


def resume(batch: BatchId) -> None:
    """Let a paused batch go on."""
    with open_store(load_settings()) as store:
        batch_id = _find(store, batch)
        held = batch_control.resume(store, batch_id, actor=audit.this_user())
    was = "goes on" if held.changed else "was not paused"
    document(batch=batch_id, changed=held.changed, waiting=held.waiting, running=held.running)
    tell(f"batch {batch_id} {was}: {held.waiting} waiting, {held.running} being graded")


def cancel(batch: BatchId) -> None:
    """End what of a batch is not graded yet; marks that are there stay."""
    with open_store(load_settings()) as store:
        batch_id = _find(store, batch)
        ended = batch_control.cancel(store, batch_id, actor=audit.this_user())
    document(batch=batch_id, changed=ended.changed, waiting=ended.waiting, running=ended.running)
    if ended.changed:
        tell(f"batch {batch_id} is cancelled: {ended.waiting} not begun, {ended.running} stopped")
    else:
        tell(f"batch {batch_id}: nothing changed, all of it has ended already")


def retry(
    batch: Annotated[str | None, typer.Argument(help="The batch's id, or the beginning of it.")] = None,
    every: Annotated[bool, typer.Option("--all", help="The dead of all batches.")] = False,
) -> None:
    """Queue again what could not be graded."""
    if (batch is not None) == every:
        raise UsageError("name one batch, or --all for the dead of all batches")
    with open_store(load_settings()) as store:
        batch_id = None if batch is None else _find(store, batch)
        retried = batch_control.retry(store, batch_id, actor=audit.this_user())
    where = "all batches" if batch_id is None else f"batch {batch_id}"
    document(batch=batch_id, queued=retried.queued, outdated=retried.outdated)
    if retried.queued + retried.outdated == 0:
        tell(f"{where}: nothing changed, no submission is dead")
        return
    outdated = f"; {retried.outdated} left, because a newer submission came" if retried.outdated else ""
    tell(f"{where}: {retried.queued} queued again{outdated}")


def _find(store: Store, start: str) -> str:
    with store.reading() as session:
        return batches.find_batch(session, start)
