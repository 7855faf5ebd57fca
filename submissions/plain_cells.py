"""The plain Python of a notebook as one file: what is called and read without playing the notebook.

Robot programs and magics are left out; playing a notebook with them is the responders' business.
"""

from __future__ import annotations

from submissions.submission import Notebook


def python_of(notebook: Notebook) -> str:
    """All cells but those that begin with a cell magic, one after the other; magic and shell lines are comments."""
    cells = (cell.source for cell in notebook.cells if not cell.source.lstrip().startswith("%%"))
    return "\n".join(_without_magics(source) for source in cells)


def _without_magics(source: str) -> str:
    return "\n".join(_commented(line) for line in source.split("\n"))


def _commented(line: str) -> str:
    """A magic in a block leaves a statement behind, so that the block is not empty."""
    stripped = line.lstrip()
    indent = line[: len(line) - len(stripped)]
    return f"{indent}pass  # {stripped}" if stripped.startswith(("%", "!")) else line
