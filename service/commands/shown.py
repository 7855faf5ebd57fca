"""What a command shows: results to standard output, in words or as one JSON document; all else to standard error.

Knows no command. A terminal gets colours and lines as wide as it is; where there is none, nothing is wrapped or cut.
"""

from __future__ import annotations

import json
import sys
from collections.abc import Collection, Mapping
from contextvars import ContextVar
from dataclasses import fields, is_dataclass
from datetime import datetime, timedelta
from decimal import Decimal
from pathlib import PurePath
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from rich.console import Console, RenderableType
    from rich.table import Table

#: Of the shape of every document; it changes when a key goes or means something else.
SCHEMA = 1

_json: ContextVar[bool] = ContextVar("json", default=False)
_quiet: ContextVar[bool] = ContextVar("quiet", default=False)
#: Wider than any line.
_UNWRAPPED = 1_000_000


def want_json(asked: bool) -> None:
    """From now on results are shown as one JSON document."""
    _json.set(asked)


def want_quiet(asked: bool) -> None:
    """From now on nothing is shown but results and what went wrong."""
    _quiet.set(asked)


def wants_json() -> bool:
    """Whether the result is to be a document."""
    return _json.get()


def document(**values: object) -> None:
    """The whole result of the command as JSON, where that is wanted."""
    if wants_json():
        print(json.dumps({"schema": SCHEMA, **values}, indent=2, default=_plain, allow_nan=False))


def tell(sentence: str) -> None:
    """A line of the result, in words."""
    if not wants_json():
        print(sentence)


def show(*parts: RenderableType) -> None:
    """Parts of the result, in words and tables."""
    if wants_json():
        return
    on_terminal = sys.stdout.isatty()
    console = _console(on_terminal, stderr=False)
    with console.capture() as shown:
        for part in parts:
            console.print(part)
    # A table fills its last column with blanks, which nobody wants in a file.
    lines = shown.get().split("\n")
    sys.stdout.write("\n".join(lines if on_terminal else (line.rstrip() for line in lines)))


def note(sentence: str) -> None:
    """A line about the work or the result, which is no part of it."""
    if not _quiet.get():
        print(sentence, file=sys.stderr)


def progress() -> Console:
    """Where it is shown how far the work is; a terminal alone shows what moves."""
    on_terminal = sys.stderr.isatty()
    return _console(on_terminal, stderr=True, quiet=_quiet.get() or not on_terminal)


def table(*headings: str, right: Collection[str] = (), title: str = "") -> Table:
    """An empty table without lines round it; ``right`` names the headings whose columns are numbers."""
    from rich.table import Table

    made = Table(box=None, pad_edge=False, title=title or None, title_justify="left", show_header=any(headings))
    for heading in headings:
        made.add_column(heading, justify="right" if heading in right else "left", overflow="fold")
    return made


def _console(on_terminal: bool, **options: Any) -> Console:
    from rich.console import Console

    return Console(width=None if on_terminal else _UNWRAPPED, highlight=False, markup=False, emoji=False, **options)


def _plain(value: Any) -> Any:
    """What JSON has no word for."""
    match value:
        case Decimal():
            return int(value) if value == value.to_integral_value() else float(value)
        case datetime():
            return value.isoformat()
        case timedelta():
            return value.total_seconds()
        case PurePath():
            return str(value)
        case Mapping():
            return dict(value)
    if is_dataclass(value):
        return {field.name: getattr(value, field.name) for field in fields(value)}
    raise TypeError(f"{type(value).__name__} has no place in a document")
