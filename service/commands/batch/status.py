"""``robomark batch status``: progress, marks and class statistics of one batch."""

from __future__ import annotations

from service.commands.batch.batch_summary import describe_unjudged, summarize_jobs
from service.commands.batch.control import BatchId
from service.commands.batch.tables import (
    build_changes_table,
    build_history_table,
    build_marks_table,
    build_rank_table,
)
from service.commands.installation import open_installation
from service.commands.output import print_json, print_line, print_renderables
from service.commands.statistics_tables import build_statistics


def status(batch: BatchId) -> None:
    """Show the progress of a batch, its marks, and their statistics."""
    from service.operations import batches
    from service.operations.batch_views import show_status

    with open_installation() as (service, actor):
        found = batches.find(service, actor, batch)
        shown = show_status(service, actor, found.course_id, found.id)
    graded, line, pace = shown.graded, shown.graded.view.batch, shown.graded.view.pace
    print_json(
        batch=line,
        pace=pace,
        jobs=graded.lines,
        changes=shown.changes,
        ranks=shown.ranks,
        unpublished_regrades=graded.waiting_regrades,
        statistics=graded.statistics,
        history=shown.history,
    )
    print_line(f"batch {line.id}: {line.name}: {summarize_jobs(line)}")
    if pace is not None:
        print_line(f"{pace.per_minute:.0f} per minute, {pace.left} left")
    print_renderables(
        build_marks_table(graded.lines, line.refusals)
        if line.regrade_of is None
        else build_changes_table(shown.changes)
    )
    print_renderables(*map(build_rank_table, shown.ranks), *build_statistics(graded.statistics))
    if unjudged := describe_unjudged(graded.lines):
        print_line(unjudged)
    if graded.waiting_regrades:
        print_line(
            f"{graded.waiting_regrades} regrades are completed but not published: robomark batch publish {line.id}"
        )
    if shown.history:
        print_renderables(build_history_table(shown.history))
