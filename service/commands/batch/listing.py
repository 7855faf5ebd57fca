"""``robomark batch list``: the newest batches as a table."""

from __future__ import annotations

from typing import Annotated

import typer

from service.commands.batch.batch_summary import summary
from service.commands.operating import operating
from service.commands.shown import document, show, table


def list_batches(
    course: Annotated[str | None, typer.Option(help="Show only this course. Default: all courses.")] = None,
) -> None:
    """List the newest batches."""
    from service.operations.batch_views import list_newest

    with operating() as (service, actor):
        lines = list_newest(service, actor, course)
    listed = table("batch", "name", "submitted", "submissions", "refused", "state", right=("submissions", "refused"))
    for line in lines:
        when = line.created_at.astimezone().strftime("%Y-%m-%d %H:%M")
        listed.add_row(line.id, line.name, when, str(line.jobs), str(len(line.refusals)), summary(line))
    document(batches=lines)
    show(listed)
