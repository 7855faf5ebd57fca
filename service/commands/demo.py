"""``robomark demo``: grade the example submissions through the queue, as a demonstration of the whole service."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

_ASSIGNMENT = "shape-recognition"


def demo(
    output: Annotated[Path, typer.Option("-o", "--output", help="The folder for the reports.")] = Path("robomark-demo"),
) -> None:
    """Grade the example submissions of one assignment through a real worker, and print the path of the report."""
    from service.commands.batch.submit import submit_and_wait
    from submissions.assignment.examples import locate_examples

    submit_and_wait(locate_examples(_ASSIGNMENT), _ASSIGNMENT, output=output)
