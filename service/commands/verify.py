"""``robomark verify``: its options. ``verification.py``, which loads slowly, does the work."""

from __future__ import annotations

from typing import Annotated

import typer


def verify(
    grade: Annotated[str, typer.Argument(help="The grade's id, or its first characters.")],
) -> None:
    """Repeat every trial of a stored grading and compare. Exit status 3 if a result differs that must not."""
    from service.commands.verification import verify_grade

    verify_grade(grade)
