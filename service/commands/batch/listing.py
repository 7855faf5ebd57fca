"""``robomark batch list``: the newest batches as a table."""

from __future__ import annotations

from typing import Annotated

import typer

from service.commands.batch.batch_summary import summarize_jobs
from service.commands.installation import open_installation
from service.commands.output import create_table, print_json, print_renderables


def list_batches(
    course: Annotated[str | None, typer.Option(help="Show only this course. Default: all courses.")] = None,
) -> None:
    """List the newest batches."""
    from service.operations.batch_views import list_newest

    with open_installation() as (service, actor):
        lines = list_newest(service, actor, course)
    table = create_table(
        "batch", "name", "submitted", "submissions", "refused", "state", right=("submissions", "refused")
    )
    for line in lines:
        timestamp = line.created_at.astimezone().strftime("%Y-%m-%d %H:%M")
        table.add_row(line.id, line.name, timestamp, str(line.jobs), str(len(line.refusals)), summarize_jobs(line))
    print_json(batches=lines)
    print_renderables(table)
