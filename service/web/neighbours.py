"""Which grades stand before and after one in the table of its batch, for pages that lead from one to the next."""

from __future__ import annotations

from dataclasses import dataclass

from service.store.batches import batch_table
from service.store.courses.hidden_names import HiddenNames
from service.store.engine import Store
from service.store.models import Job


@dataclass(frozen=True, slots=True)
class Neighbours:
    """The ids of two grades; empty where there is none."""

    before: str = ""
    after: str = ""


def neighbours(store: Store, row: Job, hidden: HiddenNames) -> Neighbours:
    """Of a job, by the names that whoever looks sees."""
    if row.batch_id is None:
        return Neighbours()
    with store.reading() as session:
        ids = [line.id for line in batch_table.table_lines(session, row.batch_id, (), hidden) if line.id]
    if row.id not in ids:
        return Neighbours()
    place = ids.index(row.id)
    return Neighbours(ids[place - 1] if place else "", ids[place + 1] if place + 1 < len(ids) else "")
