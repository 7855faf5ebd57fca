"""Plain Python of a notebook as one file, for calls of its functions without running the notebook.

Robot programs and magics are omitted. ``responders`` runs whole notebooks.
"""

from __future__ import annotations

import re

from responders.sandbox.inside.cell_source import LINE_WRAPPERS, WRAPPERS, cell_magics, wrapped
from submissions.submission import Notebook

_RUN_LINE = re.compile(rf"%(?:{'|'.join(sorted(LINE_WRAPPERS))})[ \t]+(?P<rest>.*)")


def python_of(notebook: Notebook) -> str:
    """Return all Python cells in order, with magic and shell lines as comments."""
    cells = (_python(cell.source) for cell in notebook.cells)
    return "\n".join(_without_magics(source) for source in cells if source is not None)


def _python(source: str) -> str | None:
    """Return the cell with unchanged line positions; None if its magic does not run Python."""
    lines = source.split("\n")
    above = 0
    for place, name in cell_magics(lines):
        if name not in WRAPPERS:
            return None
        above = place + 1
    return "\n".join(["#"] * above + lines[above:])


def _without_magics(source: str) -> str:
    return "\n".join(_commented(line) for line in source.split("\n"))


def _commented(line: str) -> str:
    """Replace a magic by a comment and a ``pass`` statement, so that its block is not empty."""
    stripped = line.lstrip()
    indent = line[: len(line) - len(stripped)]
    timed = _RUN_LINE.match(stripped)
    if timed is not None:
        return f"{indent}{wrapped(timed['rest'])}"
    return f"{indent}pass  # {stripped}" if stripped.startswith(("%", "!")) else line
