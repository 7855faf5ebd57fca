"""``robomark batch moderation``: the sheet of a batch for external examiners."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Annotated

import typer

from service.commands.batch.control import BatchId
from service.commands.installation import open_installation
from service.commands.output import is_json_output, print_json, print_line
from service.home import user_permissions
from sim.errors import UsageError


def moderation(
    batch: BatchId,
    assignment: Annotated[
        str, typer.Option("-a", "--assignment", help="An assignment of the batch; needed if it has several.")
    ] = "",
    output: Annotated[
        Path | None, typer.Option("-o", "--output", help="The HTML file to write. Default: the screen.")
    ] = None,
) -> None:
    """Write a page for external examiners: task, statistics, marks, adjusted marks, appeals and versions.

    Hidden names stay hidden.
    """
    from service.operations import batches
    from service.operations.moderation import download_sheet

    if output is None and is_json_output():
        raise UsageError("the sheet is HTML; name a file with --output")
    with open_installation() as (service, actor):
        stored_batch = batches.find(service, actor, batch)
        sheet = download_sheet(service, actor, stored_batch.course_id, stored_batch.id, assignment)
    if output is None:
        sys.stdout.write(sheet.data.decode())
        return
    try:
        with user_permissions():
            output.write_bytes(sheet.data)
    except OSError as error:
        raise UsageError(f"{output} cannot be written: {error.strerror}") from None
    print_json(batch=stored_batch.id, assignment=assignment, output=output, bytes=len(sheet.data))
    print_line(f"{output}: the moderation sheet of batch {stored_batch.id}")
