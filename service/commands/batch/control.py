"""``robomark batch pause``, ``resume``, ``cancel`` and ``retry``. Each command prints the change in one sentence."""

from __future__ import annotations

from typing import Annotated

import typer

from service.commands.installation import open_installation
from service.commands.output import print_json, print_line
from service.grading.class_statistics import PASS_SHARE
from sim.errors import UsageError

BatchId = Annotated[str, typer.Argument(help="The batch's id, or its first characters.")]
PassMark = Annotated[int, typer.Option("--pass", min=0, max=100, help="The pass mark, in percent of all marks.")]
DEFAULT_PASS_MARK = int(PASS_SHARE * 100)


def pause(batch: BatchId) -> None:
    """Pause a batch: start no more jobs. Running jobs continue."""
    from service.operations import batches as operations

    with open_installation() as (service, actor):
        stored_batch = operations.find(service, actor, batch)
        result = operations.pause(service, actor, stored_batch.course_id, stored_batch.id)
    state_text = "is paused" if result.changed else "was paused already"
    print_json(batch=stored_batch.id, changed=result.changed, waiting=result.waiting, running=result.running)
    print_line(f"batch {stored_batch.id} {state_text}: {result.waiting} queued, {result.running} still running")


def resume(batch: BatchId) -> None:
    """Resume a paused batch."""
    from service.operations import batches as operations

    with open_installation() as (service, actor):
        stored_batch = operations.find(service, actor, batch)
        result = operations.resume(service, actor, stored_batch.course_id, stored_batch.id)
    state_text = "is resumed" if result.changed else "was not paused"
    print_json(batch=stored_batch.id, changed=result.changed, waiting=result.waiting, running=result.running)
    print_line(f"batch {stored_batch.id} {state_text}: {result.waiting} queued, {result.running} running")


def cancel(batch: BatchId) -> None:
    """Cancel the unfinished jobs of a batch. Existing marks stay."""
    from service.operations import batches as operations

    with open_installation() as (service, actor):
        stored_batch = operations.find(service, actor, batch)
        result = operations.cancel(service, actor, stored_batch.course_id, stored_batch.id)
    print_json(batch=stored_batch.id, changed=result.changed, waiting=result.waiting, running=result.running)
    if result.changed:
        print_line(
            f"batch {stored_batch.id} is cancelled: {result.waiting} queued jobs cancelled, {result.running} running "
            "jobs stopped"
        )
    else:
        print_line(f"batch {stored_batch.id}: nothing changed, all its jobs have ended")


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
    scope = "all batches" if batch_id is None else f"batch {batch_id}"
    print_json(batch=batch_id, queued=retried.queued, outdated=retried.outdated)
    if retried.queued + retried.outdated == 0:
        print_line(f"{scope}: nothing changed, there are no failed jobs")
        return
    outdated = f"; {retried.outdated} left out, because there is a newer submission" if retried.outdated else ""
    print_line(f"{scope}: {retried.queued} queued again{outdated}")
