"""The plain Python of a notebook as one file, so that its functions can be called without executing it.

Robot programs and magics are left out; playing a notebook with them is the responders' business.
"""

from __future__ import annotations

import re

from submissions.submission import Notebook

#: Cell magics whose cell is run as Python, as ``%time`` does with its line.
_RUN = re.compile(r"%%(?:time|capture)\b")
_RUN_LINE = re.compile(r"%time[ \t]+(?P<rest>.*)")


def python_of(notebook: Notebook) -> str:
    """All cells that are run as Python, one after the other; magic and shell lines are comments."""
    cells = (cell.source for cell in notebook.cells)
    return "\n".join(
        _without_magics(source) for source in cells if not source.lstrip().startswith("%%") or _is_run(source)
    )


def _is_run(source: str) -> bool:
    return _RUN.match(source.lstrip()) is not None


def _without_magics(source: str) -> str:
    return "\n".join(_commented(line) for line in source.split("\n"))


def _commented(line: str) -> str:
    """A magic in a block leaves a statement behind, so that the block is not empty."""
    stripped = line.lstrip()
    indent = line[: len(line) - len(stripped)]
    timed = _RUN_LINE.match(stripped)
    if timed is not None:
        return f"{indent}{timed['rest']}"
    return f"{indent}pass  # {stripped}" if stripped.startswith(("%", "!")) else line
