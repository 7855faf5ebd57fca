"""``robomark batch status``: how far one batch is, the marks that are there, and what they come to for a class."""

from __future__ import annotations

from service.commands.batch.control import BatchId
from service.commands.batch.tables import (
    changes_table,
    history_table,
    marks_table,
    rank_table,
)
from service.commands.batch.words import summary, unjudged_words
from service.commands.shown import document, show, tell
from service.commands.statistics_shown import statistics_parts
from service.grading.statistics import statistics_of
from service.settings import load_settings
from service.store import audit
from service.store.batches import batches, publishing, rankings, regrades
from service.store.engine import open_store
from service.store.grades.marked import marked
from service.store.queue import metrics


def status(batch: BatchId) -> None:
    """How far a batch is, the marks that are there, and their statistics."""
    with open_store(load_settings()) as store, store.reading() as session:
        line = batches.batch(session, batches.find_batch(session, batch))
        lines = batches.job_lines(session, line.id)
        ranks = rankings.rank_tables(session, lines)
        changes = [] if line.regrade_of is None else regrades.changes(session, line.id)
        waiting = 0 if line.regrade_of is not None else publishing.unpublished_regrades(session, line.id)
        history = audit.entries(session, "batch", line.id)
        pace = metrics.pace(session, line.id)
        statistics = statistics_of(marked(session, lines))
    document(
        batch=line,
        pace=pace,
        jobs=lines,
        changes=changes,
        ranks=ranks,
        unpublished_regrades=waiting,
        statistics=statistics,
        history=history,
    )
    tell(f"batch {line.id}: {line.name}: {summary(line)}")
    if pace is not None:
        tell(f"{pace.per_minute:.0f} a minute, {pace.left} left")
    show(marks_table(lines, line.refusals) if line.regrade_of is None else changes_table(changes))
    show(*map(rank_table, ranks), *statistics_parts(statistics))
    if unjudged := unjudged_words(lines):
        tell(unjudged)
    if waiting:
        tell(f"{waiting} regrades are done and not published: robomark batch publish {line.id}")
    if history:
        show(history_table(history))
