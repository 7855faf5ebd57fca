"""``robomark batch list``: the newest batches, a line each."""

from __future__ import annotations

from service.commands.batch.words import summary
from service.commands.shown import document, show, table
from service.settings import load_settings
from service.store import batches
from service.store.engine import open_store


def list_batches() -> None:
    """The newest batches."""
    with open_store(load_settings()) as store, store.reading() as session:
        lines = batches.list_batches(session)
    listed = table("batch", "name", "taken in", "submissions", "refused", "state", right=("submissions", "refused"))
    for line in lines:
        when = line.created_at.astimezone().strftime("%Y-%m-%d %H:%M")
        listed.add_row(line.id, line.name, when, str(line.jobs), str(len(line.refusals)), summary(line))
    document(batches=lines)
    show(listed)
