"""``robomark batch status``: progress, marks and class statistics of one batch."""

from __future__ import annotations

from service.commands.batch.batch_summary import summary, unjudged_words
from service.commands.batch.control import BatchId
from service.commands.batch.tables import (
    changes_table,
    history_table,
    marks_table,
    rank_table,
)
from service.commands.operating import operating
from service.commands.shown import document, show, tell
from service.commands.statistics_shown import statistics_parts


def status(batch: BatchId) -> None:
    """Show the progress of a batch, its marks, and their statistics."""
    from service.operations import batches
    from service.operations.batch_views import show_status

    with operating() as (service, actor):
        found = batches.find(service, actor, batch)
        shown = show_status(service, actor, found.course_id, found.id)
    graded, line, pace = shown.graded, shown.graded.view.batch, shown.graded.view.pace
    document(
        batch=line,
        pace=pace,
        jobs=graded.lines,
        changes=shown.changes,
        ranks=shown.ranks,
        unpublished_regrades=graded.waiting_regrades,
        statistics=graded.statistics,
        history=shown.history,
    )
    tell(f"batch {line.id}: {line.name}: {summary(line)}")
    if pace is not None:
        tell(f"{pace.per_minute:.0f} per minute, {pace.left} left")
    show(marks_table(graded.lines, line.refusals) if line.regrade_of is None else changes_table(shown.changes))
    show(*map(rank_table, shown.ranks), *statistics_parts(graded.statistics))
    if unjudged := unjudged_words(graded.lines):
        tell(unjudged)
    if graded.waiting_regrades:
        tell(f"{graded.waiting_regrades} regrades are completed but not published: robomark batch publish {line.id}")
    if shown.history:
        show(history_table(shown.history))
