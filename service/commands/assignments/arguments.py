"""The command-line argument that names an assignment."""

from __future__ import annotations

from typing import Annotated

import typer

AssignmentArgument = Annotated[str, typer.Argument(help="The assignment's id in the catalogue, or its folder.")]


def format_count(number: int, singular: str, plural: str) -> str:
    """Return the number with its noun: ``1 trial``, ``2 trials``."""
    return f"{number} {singular if number == 1 else plural}"
