"""``robomark batch pause``, ``resume``, ``cancel`` and ``retry``. Each command prints the change in one sentence."""

from __future__ import annotations

from typing import Annotated

import typer

from service.commands.installation import open_installation
from service.commands.output import print_json, print_line
from sim.errors import UsageError

BatchId = Annotated[str, typer.Argument(help="The batch's id, or its first characters.")]


def pause(batch: BatchId) -> None:
    """Pause a batch: start no more jobs. Running jobs continue."""
    from service.operations import batches as operations

    with open_installation() as (service, actor):
        found = operations.find(service, actor, batch)
        held = operations.pause(service, actor, found.course_id, found.id)
    was = "is paused" if held.changed else "was paused already"
    print_json(batch=found.id, changed=held.changed, waiting=held.waiting, running=held.running)
    print_line(f"batch {found.id} {was}: {held.waiting} queued, {held.running} still running")


def resume(batch: BatchId) -> None:
    """Resume a paused batch."""
    from service.operations import batches as operations

    with open_installation() as (service, actor):
        found = operations.find(service, actor, batch)
        held = operations.resume(service, actor, found.course_id, found.id)
    was = "is resumed" if held.changed else "was not paused"
    print_json(batch=found.id, changed=held.changed, waiting=held.waiting, running=held.running)
    print_line(f"batch {found.id} {was}: {held.waiting} queued, {held.running} running")


def cancel(batch: BatchId) -> None:
    """Cancel the unfinished jobs of a batch. Existing marks stay."""
    from service.operations import batches as operations

    with open_installation() as (service, actor):
        found = operations.find(service, actor, batch)
        ended = operations.cancel(service, actor, found.course_id, found.id)
    print_json(batch=found.id, changed=ended.changed, waiting=ended.waiting, running=ended.running)
    if ended.changed:
        print_line(
            f"batch {found.id} is cancelled: {ended.waiting} queued jobs cancelled, {ended.running} running jobs "
            "stopped"
        )
    else:
        print_line(f"batch {found.id}: nothing changed, all its jobs have ended")


def retry(
    batch: Annotated[str | None, typer.Argument(help="The batch's id, or its first characters.")] = None,
    every: Annotated[bool, typer.Option("--all", help="Retry the failed jobs of all batches.")] = False,
) -> None:
    """Queue failed jobs again."""
    from service.operations import batches as operations

    if (batch is not None) == every:
        raise UsageError("name one batch, or use --all for the failed jobs of all batches")
    with open_installation() as (service, actor):
        batch_id = None if batch is None else operations.find(service, actor, batch).id
        retried = operations.retry_dead(service, actor, batch_id)
    where = "all batches" if batch_id is None else f"batch {batch_id}"
    print_json(batch=batch_id, queued=retried.queued, outdated=retried.outdated)
    if retried.queued + retried.outdated == 0:
        print_line(f"{where}: nothing changed, there are no failed jobs")
        return
    outdated = f"; {retried.outdated} left out, because there is a newer submission" if retried.outdated else ""
    print_line(f"{where}: {retried.queued} queued again{outdated}")
