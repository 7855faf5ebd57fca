"""The plain Python of a notebook as one file, so that its functions can be called without executing it.

Robot programs and magics are left out; playing a notebook with them is the responders' business.
"""

from __future__ import annotations

import re

from responders.sandbox.inside.cell_source import LINE_WRAPPERS, WRAPPERS, cell_magics, wrapped
from submissions.submission import Notebook

_RUN_LINE = re.compile(rf"%(?:{'|'.join(sorted(LINE_WRAPPERS))})[ \t]+(?P<rest>.*)")


def python_of(notebook: Notebook) -> str:
    """All cells that are run as Python, one after the other; magic and shell lines are comments."""
    cells = (_python(cell.source) for cell in notebook.cells)
    return "\n".join(_without_magics(source) for source in cells if source is not None)


def _python(source: str) -> str | None:
    """The cell with its lines in their places; None if it is for a magic that runs no Python."""
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
    """A magic in a block leaves a statement behind, so that the block is not empty."""
    stripped = line.lstrip()
    indent = line[: len(line) - len(stripped)]
    timed = _RUN_LINE.match(stripped)
    if timed is not None:
        return f"{indent}{wrapped(timed['rest'])}"
    return f"{indent}pass  # {stripped}" if stripped.startswith(("%", "!")) else line
