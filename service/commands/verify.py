"""``robomark verify``: its options. The modules that do the work load slowly."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from sim.errors import UsageError


def verify(
    grade: Annotated[
        str, typer.Argument(help="The grade's id, or its first characters; or the file of a statement or receipt.")
    ],
    keys: Annotated[
        Path | None, typer.Option(help="The installation's public keys, from its page Statement keys. For files.")
    ] = None,
    submission: Annotated[
        Path | None, typer.Option(help="The submission that the statement must name. For files.")
    ] = None,
    assignment: Annotated[
        str | None,
        typer.Option("-a", "--assignment", help="Repeat the grading: the assignment's id or folder. For files."),
    ] = None,
) -> None:
    """Repeat every trial of a stored grading and compare, or check a statement. Exit status 3 if something differs."""
    path = Path(grade)
    if path.is_file():
        from service.commands.statement_verification import VerificationOptions, verify_file

        verify_file(path, VerificationOptions(keys, submission, assignment))
        return
    if keys is not None or submission is not None or assignment is not None:
        raise UsageError(f"{grade}: is not a file; --keys, --submission and --assignment are for statements")
    from service.commands.verification import verify_grade

    verify_grade(grade)
