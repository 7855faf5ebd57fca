"""``robomark batch similar``: its options. ``similarity_list.py``, which loads slowly, does the work."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from service.commands.batch.control import BatchId


def similar(
    batch: BatchId,
    given: Annotated[
        Path | None, typer.Option(help="A file or folder of Python code given to students. It is excluded.")
    ] = None,
    output: Annotated[
        Path | None, typer.Option("-o", "--output", help="Write a page with the evidence side by side to this folder.")
    ] = None,
) -> None:
    """List similar submissions of a batch, by their code and by their robots' behaviour; for staff only.

    Similarity is a reason to look closer, not a proof. It changes no marks, and students never see it.
    """
    from service.commands.batch.similarity_list import find_similar

    find_similar(batch, given, output)
