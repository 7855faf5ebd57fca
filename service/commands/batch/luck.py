"""``robomark batch luck``: its options. ``luck_report.py``, which loads slowly, does the work."""

from __future__ import annotations

from typing import Annotated

import typer

from service.commands.batch.control import BatchId


def luck(
    batch: BatchId,
    submissions: Annotated[
        int, typer.Option(min=1, help="Submissions for each assignment, spread over the marks.")
    ] = 10,
    draws: Annotated[int, typer.Option(min=1, help="Other draws of each random stream for each submission.")] = 8,
    cpu_seconds: Annotated[float, typer.Option(min=1, help="CPU seconds for all trials of the report together.")] = 300,
) -> None:
    """Show how much of each criterion's marks is luck: start pose, noise and messages; for staff only.

    Trials of stored submissions run again with one random stream drawn anew and everything else the same. No marks
    change.
    """
    from service.commands.batch.luck_report import report_luck

    report_luck(batch, submissions, draws, cpu_seconds)
