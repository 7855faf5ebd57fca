"""Plain Python of a notebook as one file, for calls of its functions without running the notebook.

Robot programs and magics are omitted. ``responders`` runs whole notebooks.
"""

from __future__ import annotations

import re

from responders.sandbox.inside.cell_source import LINE_WRAPPERS, WRAPPERS, extract_wrapped_code, list_cell_magics
from submissions.submission import Notebook

_RUN_LINE = re.compile(rf"%(?:{'|'.join(sorted(LINE_WRAPPERS))})[ \t]+(?P<rest>.*)")


def extract_python(notebook: Notebook) -> str:
    """Return all Python cells in order, with magic and shell lines as comments."""
    cells = (_extract_cell_python(cell.source) for cell in notebook.cells)
    return "\n".join(_comment_out_magics(source) for source in cells if source is not None)


def _extract_cell_python(source: str) -> str | None:
    """Return the cell with unchanged line positions; None if its magic does not run Python."""
    lines = source.split("\n")
    magic_lines = 0
    for index, name in list_cell_magics(lines):
        if name not in WRAPPERS:
            return None
        magic_lines = index + 1
    return "\n".join(["#"] * magic_lines + lines[magic_lines:])


def _comment_out_magics(source: str) -> str:
    return "\n".join(_comment_out_line(line) for line in source.split("\n"))


def _comment_out_line(line: str) -> str:
    """Replace a magic by a comment and a ``pass`` statement, so that its block is not empty."""
    stripped = line.lstrip()
    indent = line[: len(line) - len(stripped)]
    timing_match = _RUN_LINE.match(stripped)
    if timing_match is not None:
        return f"{indent}{extract_wrapped_code(timing_match['rest'])}"
    return f"{indent}pass  # {stripped}" if stripped.startswith(("%", "!")) else line
