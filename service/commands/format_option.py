"""The option ``--format``: one of the registered output formats, refused by name where there is no such one.

What a format writes is ``service.reports.formats``'.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import Any

import typer


def format_option(words: str, names: Callable[[], Iterable[str]]) -> Any:
    """An option that takes one of ``names``, which are asked for when it is given: the formats take long to load."""

    def checked(name: str) -> str:
        known = tuple(names())
        if name not in known:
            raise typer.BadParameter(f"{name!r} is not one of {', '.join(map(repr, known))}")
        return name

    def completed(start: str) -> list[str]:
        return [name for name in names() if name.startswith(start)]

    return typer.Option("--format", help=words, metavar="FORMAT", callback=checked, autocompletion=completed)
