"""``robomark batch export``: its options. ``batch_export.py``, which loads slowly, does the work."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path
from typing import Annotated

import typer

from service.commands.batch.control import BatchId
from service.commands.options import create_format_option
from service.commands.output import is_json_output


def export(
    batch: BatchId,
    form: Annotated[
        str, create_format_option("Output format. An unknown format lists the available ones.", _list_formats)
    ] = "csv",
    output: Annotated[
        Path | None,
        typer.Option(
            "-o", "--output", help="Write to this file, or one file each to this folder. Default: the screen."
        ),
    ] = None,
    published: Annotated[bool, typer.Option("--published", help="Export only published grades.")] = False,
    worksheet: Annotated[
        Path | None, typer.Option(help="Moodle's grading worksheet, for --format moodle-worksheet.")
    ] = None,
) -> None:
    """Export the marks of a batch for a spreadsheet, Moodle, Gradescope or a test page, or as JSON.

    Every student has a row. Rejected submissions and those without a grade have the reason.
    """
    from service.commands.batch.batch_export import export_batch

    export_batch(batch, "json" if is_json_output() else form, output, worksheet, published=published)


def _list_formats() -> Iterable[str]:
    from service.reports.formats import FORMATS

    return FORMATS
