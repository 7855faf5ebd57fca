"""The plain Python of a hand-in without playing it: of a notebook as one file, and of the modules that lie beside it.

Robot programs and magics are left out; playing a notebook with them is the responders' business.
"""

from __future__ import annotations

import re
from collections.abc import Iterator

from sim.errors import UsageError
from submissions.source_text import decode_source
from submissions.submission import Notebook, Source, Submission

#: Cell magics whose cell is run as Python, as ``%time`` does with its line; and those that write a file.
_RUN = re.compile(r"%%(?:time|capture)\b")
_RUN_LINE = re.compile(r"%time[ \t]+(?P<rest>.*)")
_WRITE = re.compile(r"%%(?:writefile|file)[ \t]+(?:(?:-a|--append)[ \t]+)?(?P<name>\S+\.py)[ \t]*$")
_MOST_MODULES = 20


def python_of(notebook: Notebook) -> str:
    """All cells that are run as Python, one after the other; magic and shell lines are comments."""
    cells = (cell.source for cell in notebook.cells)
    return "\n".join(
        _without_magics(source) for source in cells if not source.lstrip().startswith("%%") or _is_run(source)
    )


def modules_of(submission: Submission) -> tuple[Source, ...]:
    """The Python files beside the parts, and those that a notebook writes, which its code may import."""
    files = [(name, data) for name, data in submission.files.items() if name.lower().endswith(".py")]
    found = [Source(name, _decoded(data, name)) for name, data in files]
    if submission.notebook is not None:
        found += _written(submission.notebook)
    return tuple(found[:_MOST_MODULES])


def _written(notebook: Notebook) -> Iterator[Source]:
    for cell in notebook.cells:
        first, _, body = cell.source.lstrip().partition("\n")
        match = _WRITE.match(first)
        if match is not None:
            yield Source(match["name"], body)


def _decoded(data: bytes, name: str) -> str:
    """Empty for what cannot be read as a Python file, because it cannot be imported either."""
    try:
        return decode_source(data, name).text
    except UsageError:
        return ""


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
