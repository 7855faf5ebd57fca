"""Shared parts of the model commands: arguments, formatting of intervals, and writing files."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from models.cards import Tally
from service.commands.output import print_note
from service.home import user_permissions
from sim.errors import UsageError

Name = Annotated[str, typer.Argument(help="The model's name, as shown by robomark models list.")]
Output = Annotated[Path | None, typer.Option("-o", "--output", help="Write the plots and the numbers to this folder.")]


def format_interval(tally: Tally) -> str:
    """Return the 95 % interval as text."""
    low, high = tally.interval
    return f"{low:.3f} to {high:.3f}"


def write_output(path: Path, data: bytes) -> None:
    """Write a file and print its path. Raises UsageError if it cannot be written."""
    try:
        with user_permissions():
            path.write_bytes(data)
    except OSError as error:
        raise UsageError(f"{path} cannot be written: {error.strerror}") from error
    print_note(str(path))
