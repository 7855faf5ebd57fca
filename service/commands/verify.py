"""``robomark verify``: its options. ``verifying.py``, which loads slowly, does the work."""

from __future__ import annotations

from typing import Annotated

import typer


def verify(
    grade: Annotated[str, typer.Argument(help="The grade's id, or the beginning of it.")],
) -> None:
    """Run a stored grading again, every trial of it, and compare; exit status 3 if anything differs that must not."""
    from service.commands.verifying import verify_grade

    verify_grade(grade)
