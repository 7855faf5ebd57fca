"""``robomark demo``: grades the example submissions through the queue, as a first look at the whole service."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from service.commands.batch.app import submit_and_wait
from submissions.assignment.examples import examples

_ASSIGNMENT = "shape-recognition"


def demo(
    folder: Annotated[Path, typer.Option("--into", help="Where the reports go.")] = Path("robomark-demo"),
) -> None:
    """Grade the example submissions of one assignment through a real worker, and say where the report is."""
    submit_and_wait(examples(_ASSIGNMENT), _ASSIGNMENT, report=folder)
