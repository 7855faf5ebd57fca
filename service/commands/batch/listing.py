"""``robomark batch list``: the newest batches, a line each."""

from __future__ import annotations

from typing import Annotated

import typer

from service.commands.batch.words import summary
from service.commands.shown import document, show, table
from service.settings import load_settings
from service.store.batches import batches
from service.store.engine import open_store
from service.store.people.people import find_course


def list_batches(
    course: Annotated[str | None, typer.Option(help="Of this course only; else of all.")] = None,
) -> None:
    """The newest batches."""
    with open_store(load_settings()) as store, store.reading() as session:
        lines = batches.list_batches(session, None if course is None else find_course(session, course))
    listed = table("batch", "name", "taken in", "submissions", "refused", "state", right=("submissions", "refused"))
    for line in lines:
        when = line.created_at.astimezone().strftime("%Y-%m-%d %H:%M")
        listed.add_row(line.id, line.name, when, str(line.jobs), str(len(line.refusals)), summary(line))
    document(batches=lines)
    show(listed)
