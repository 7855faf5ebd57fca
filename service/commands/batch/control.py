"""``robomark batch pause``, ``resume``, ``cancel`` and ``retry``. Each command prints the change in one sentence."""

from __future__ import annotations

from typing import Annotated

import typer

from service.commands.operating import operating
from service.commands.shown import document, tell
from sim.errors import UsageError

BatchId = Annotated[str, typer.Argument(help="The batch's id, or the beginning of it.")]


def pause(batch: BatchId) -> None:
    """Pause a batch: start no more jobs. Running jobs continue."""
    from service.operations import batches as operations

    with operating() as (service, actor):
        found = operations.find(service, actor, batch)
        held = operations.pause(service, actor, found.course_id, found.id)
    was = "is paused" if held.changed else "was paused already"
    document(batch=found.id, changed=held.changed, waiting=held.waiting, running=held.running)
    tell(f"batch {found.id} {was}: {held.waiting} waiting, {held.running} graded to their end")


def resume(batch: BatchId) -> None:
    """Resume a paused batch."""
    from service.operations import batches as operations

    with operating() as (service, actor):
        found = operations.find(service, actor, batch)
        held = operations.resume(service, actor, found.course_id, found.id)
    was = "goes on" if held.changed else "was not paused"
    document(batch=found.id, changed=held.changed, waiting=held.waiting, running=held.running)
    tell(f"batch {found.id} {was}: {held.waiting} waiting, {held.running} being graded")


def cancel(batch: BatchId) -> None:
    """End what of a batch is not graded yet; marks that are there stay."""
    from service.operations import batches as operations

    with operating() as (service, actor):
        found = operations.find(service, actor, batch)
        ended = operations.cancel(service, actor, found.course_id, found.id)
    document(batch=found.id, changed=ended.changed, waiting=ended.waiting, running=ended.running)
    if ended.changed:
        tell(f"batch {found.id} is cancelled: {ended.waiting} not begun, {ended.running} stopped")
    else:
        tell(f"batch {found.id}: nothing changed, all of it has ended already")


def retry(
    batch: Annotated[str | None, typer.Argument(help="The batch's id, or the beginning of it.")] = None,
    every: Annotated[bool, typer.Option("--all", help="The dead of all batches.")] = False,
) -> None:
    """Queue failed jobs again."""
    from service.operations import batches as operations

    if (batch is not None) == every:
        raise UsageError("name one batch, or --all for the dead of all batches")
    with operating() as (service, actor):
        batch_id = None if batch is None else operations.find(service, actor, batch).id
        retried = operations.retry_dead(service, actor, batch_id)
    where = "all batches" if batch_id is None else f"batch {batch_id}"
    document(batch=batch_id, queued=retried.queued, outdated=retried.outdated)
    if retried.queued + retried.outdated == 0:
        tell(f"{where}: nothing changed, no submission is dead")
        return
    outdated = f"; {retried.outdated} left, because a newer submission came" if retried.outdated else ""
    tell(f"{where}: {retried.queued} queued again{outdated}")
