"""``robomark batch status``: progress, marks and class statistics of one batch."""

from __future__ import annotations

from decimal import Decimal

from service.commands.batch.batch_summary import describe_unjudged, summarize_jobs
from service.commands.batch.control import DEFAULT_PASS_MARK, BatchId, PassMark
from service.commands.batch.tables import (
    build_changes_table,
    build_history_table,
    build_marks_table,
    build_rank_table,
)
from service.commands.installation import open_installation
from service.commands.output import print_json, print_line, print_renderables
from service.commands.statistics_tables import build_statistics


def status(batch: BatchId, pass_mark: PassMark = DEFAULT_PASS_MARK) -> None:
    """Show the progress of a batch, its marks, and their statistics."""
    from service.operations import batches
    from service.operations.batch_views import show_status

    with open_installation() as (service, actor):
        stored_batch = batches.find(service, actor, batch)
        batch_status = show_status(service, actor, stored_batch.course_id, stored_batch.id, Decimal(pass_mark) / 100)
    grading, line, pace = batch_status.graded, batch_status.graded.view.batch, batch_status.graded.view.pace
    print_json(
        batch=line,
        pace=pace,
        jobs=grading.lines,
        changes=batch_status.changes,
        changes_summary=batch_status.changes_summary,
        ranks=batch_status.ranks,
        unpublished_regrades=grading.waiting_regrades,
        statistics=grading.statistics,
        history=batch_status.history,
    )
    print_line(f"batch {line.id}: {line.name}: {summarize_jobs(line)}")
    if pace is not None:
        print_line(f"{pace.per_minute:.0f} per minute, {pace.left} left")
    print_renderables(
        build_marks_table(grading.lines, line.refusals)
        if batch_status.changes_summary is None
        else build_changes_table(batch_status.changes, batch_status.changes_summary)
    )
    print_renderables(*map(build_rank_table, batch_status.ranks), *build_statistics(grading.statistics))
    if unjudged := describe_unjudged(grading.lines):
        print_line(unjudged)
    if grading.waiting_regrades:
        print_line(
            f"{grading.waiting_regrades} regrades are completed but not published: robomark batch publish {line.id}"
        )
    if batch_status.history:
        print_renderables(build_history_table(batch_status.history))
