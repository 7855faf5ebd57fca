"""Output of commands: results to standard output as text or one JSON document, everything else to standard error.

The module is independent of the commands. On a terminal, output has colours and the terminal's width. Otherwise no line
is wrapped or shortened.
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


#: Version of the JSON documents. It changes when a key is removed or changes its meaning.
SCHEMA = 1

_json_output: ContextVar[bool] = ContextVar("json", default=False)
_quiet_output: ContextVar[bool] = ContextVar("quiet", default=False)
#: A width that no line reaches.
_UNLIMITED_WIDTH = 1_000_000


def set_json_output(is_enabled: bool) -> None:
    """Select JSON output for the rest of this command."""
    _json_output.set(is_enabled)


def set_quiet_output(is_enabled: bool) -> None:
    """Suppress everything except results and errors for the rest of this command."""
    _quiet_output.set(is_enabled)


def is_json_output() -> bool:
    """Return whether the output format is JSON."""
    return _json_output.get()


def print_json(**values: object) -> None:
    """Print the command's whole result as a JSON document, if JSON output is selected."""
    if is_json_output():
        print(json.dumps({"schema": SCHEMA, **values}, indent=2, default=_to_plain_value, allow_nan=False))


def print_line(sentence: str) -> None:
    """Print a line of the result, unless JSON output is selected."""
    if not is_json_output():
        print(sentence)


def print_renderables(*parts: RenderableType) -> None:
    """Print texts and tables of the result, unless JSON output is selected."""
    if is_json_output():
        return
    on_terminal = sys.stdout.isatty()
    console = _create_console(on_terminal, stderr=False)
    with console.capture() as capture:
        for part in parts:
            console.print(part)
    # Rich pads the last column with spaces, which are removed in files.
    lines = capture.get().split("\n")
    sys.stdout.write("\n".join(lines if on_terminal else (line.rstrip() for line in lines)))


def print_note(sentence: str) -> None:
    """Print a message to standard error, unless ``--quiet`` is set."""
    if not _quiet_output.get():
        print(sentence, file=sys.stderr)


def create_progress_console() -> Console:
    """Return the console for progress bars. It shows them only on a terminal."""
    on_terminal = sys.stderr.isatty()
    return _create_console(on_terminal, stderr=True, quiet=_quiet_output.get() or not on_terminal)


def create_table(*headings: str, right: Collection[str] = (), title: str = "") -> Table:
    """Return an empty table without borders. ``right`` contains the headings of right-aligned columns."""
    from rich.table import Table

    table = Table(box=None, pad_edge=False, title=title or None, title_justify="left", show_header=any(headings))
    for heading in headings:
        table.add_column(heading, justify="right" if heading in right else "left", overflow="fold")
    return table


def _create_console(on_terminal: bool, **options: Any) -> Console:
    from rich.console import Console

    return Console(
        width=None if on_terminal else _UNLIMITED_WIDTH, highlight=False, markup=False, emoji=False, **options
    )


def _to_plain_value(value: Any) -> Any:
    """Convert a value that JSON does not support. Raises TypeError for an unknown type."""
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
    raise TypeError(f"{type(value).__name__} cannot be written to a JSON document")


def warn_about_missing_sandbox() -> None:
    """Print the warning. ``--quiet`` does not suppress it."""
    print("robomark: NO SANDBOX: these submissions can read and change all your files", file=sys.stderr)
