"""The option ``--format``: one of the registered output formats, refused by name where there is no such one.

What a format writes is ``service.reports.formats``'.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import typer


def format_option(words: str, names: Iterable[str]) -> Any:
    """An option that takes one of ``names``."""
    known = tuple(names)

    def checked(name: str) -> str:
        if name not in known:
            raise typer.BadParameter(f"{name!r} is not one of {', '.join(map(repr, known))}")
        return name

    return typer.Option("--format", help=words, metavar=f"[{'|'.join(known)}]", callback=checked)
