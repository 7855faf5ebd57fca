"""Conversion of notebook cells from IPython syntax to Python: magics, shell lines and ``?`` become calls.

Line numbers don't change. ``shell.py`` implements the calls.
"""

from __future__ import annotations

import re
import string
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from typing import Any

#: Cell magics that run the rest of their cell as Python.
WRAPPERS = frozenset(
    ("capture", "heat", "lprun", "memit", "mprun", "nbtutor", "prun", "scalene", "snakeviz", "time", "timeit")
)
#: Line magics that run the rest of their line as Python, after their options.
LINE_WRAPPERS = frozenset(("time", "timeit", "prun", "memit"))

_OPTIONS = re.compile(r"(?:-[nrpl][ \t]*\d+[ \t]+|-s[ \t]+\w+[ \t]+|-\w+[ \t]+)*")
_CELL_MAGIC = re.compile(r"%%(?P<name>[A-Za-z_]\w*)(?:[ \t]+(?P<line>.*))?\Z")
_LINE_MAGIC = re.compile(r"%(?P<name>[A-Za-z_]\w*)(?:[ \t]+(?P<line>.*))?\Z")
_ASSIGNMENT = re.compile(r"(?P<target>[A-Za-z_][\w.,\[\]'\" ]*=[ \t]*)(?P<rest>[%!].*)\Z")
_QUESTION = re.compile(r"(?:\?{1,2}[\w.%]+|%{0,2}[A-Za-z_][\w.]*\?{1,2})\Z")
_PACKAGES = re.compile(r"(?P<name>pip3?|conda|mamba)[ \t]+(?P<line>(?:install|uninstall|list|show|freeze)\b.*)\Z")
_DOLLAR = re.compile(r"\$(?:(?P<escaped>\$[\w.]*)|(?P<name>[A-Za-z_][\w.]*))")


@dataclass(frozen=True, slots=True)
class CellMagic:
    """A cell with a cell magic. ``line`` is the text after its name."""

    name: str
    line: str
    body: str
    number: int  # line number of the magic, from 1


def parse_cell_magic(source: str) -> CellMagic | None:
    """Return the cell magic if the first line, after blanks and comments, begins with ``%%``."""
    lines = source.split("\n")
    for index, line in enumerate(lines):
        stripped = line.lstrip("\ufeff").strip()
        if not stripped or stripped.startswith("#"):
            continue
        match = _CELL_MAGIC.match(stripped)
        if match is None:
            return None
        return CellMagic(match["name"], match["line"] or "", "\n".join(lines[index + 1 :]), index + 1)
    return None


def list_cell_magics(lines: Iterable[str]) -> Iterator[tuple[int, str]]:
    """Yield the index and name of each cell magic at the start: the first one, and those that it wraps in turn."""
    for index, line in enumerate(lines):
        stripped = line.lstrip("\ufeff").strip()
        if not stripped or stripped.startswith("#"):
            continue
        match = _CELL_MAGIC.match(stripped)
        if match is None:
            return
        yield index, match["name"]


def extract_wrapped_code(line: str) -> str:
    """Return the Python code in the line of a wrapping magic."""
    return convert_to_python(line[_OPTIONS.match(line).end() :])  # type: ignore[union-attr]


def convert_to_python(source: str) -> str:
    """Return the cell as Python with the same lines."""
    lines = source.lstrip("\ufeff").split("\n")
    for index in list(_list_statement_starts(lines)):
        line = lines[index]
        if not _may_be_special(line):
            continue
        text, line_count = line, 1
        while text.endswith("\\") and index + line_count < len(lines):
            text = text[:-1] + " " + lines[index + line_count].strip()
            line_count += 1
        rewritten = _rewrite_line(text)
        if rewritten is not None:
            lines[index : index + line_count] = [rewritten] + [""] * (line_count - 1)
    return "\n".join(lines)


def expand_line(line: str, names: Mapping[str, Any]) -> str:
    """Return ``line`` with ``{expression}`` and ``$name`` replaced by their values, or unchanged if one fails."""
    try:
        return "".join(_expand_parts(line, names))
    except Exception:
        return line


def list_expressions(line: str) -> Iterator[str]:
    """Yield the expressions that ``expand_line`` evaluates, as far as the line can be parsed."""
    try:
        for literal, expression, _, _ in string.Formatter().parse(line):
            yield from (match["name"] for match in _DOLLAR.finditer(literal) if match["name"])
            if expression is not None:
                yield expression
    except ValueError:
        return


def _expand_parts(line: str, names: Mapping[str, Any]) -> Iterator[str]:
    formatter = string.Formatter()
    for literal, expression, form, conversion in formatter.parse(line):
        yield _DOLLAR.sub(
            lambda match: match["escaped"] or str(eval(match["name"], dict(names))),
            literal,
        )
        if expression is not None:
            value = formatter.convert_field(eval(expression, dict(names)), conversion)
            yield format(value, form or "")


def _may_be_special(line: str) -> bool:
    stripped = line.strip()
    return stripped.startswith(("%", "!", "?")) or stripped.endswith("?") or _has_special_form(stripped)


def _has_special_form(stripped: str) -> bool:
    return _ASSIGNMENT.match(stripped) is not None or _PACKAGES.match(stripped) is not None


def _rewrite_line(text: str) -> str | None:
    """Return the call for a line with a magic, or None for a line of Python."""
    stripped = text.strip()
    indent = text[: len(text) - len(text.lstrip())]
    assignment = _ASSIGNMENT.match(stripped)
    if assignment is not None:
        call = _build_call(assignment["rest"].strip(), is_captured=True)
        return None if call is None else f"{indent}{assignment['target']}{call}"
    if _QUESTION.match(stripped):
        return f"{indent}get_ipython().run_line_magic('pinfo', {stripped.strip('?')!r})"
    packages = _PACKAGES.match(stripped)
    if packages is not None:
        return f"{indent}get_ipython().run_line_magic({packages['name']!r}, {packages['line']!r})"
    call = _build_call(stripped, is_captured=False)
    return None if call is None else indent + call


def _build_call(text: str, is_captured: bool) -> str | None:
    if text.startswith("!!"):
        return f"get_ipython().getoutput({text[2:]!r})"
    if text.startswith("!"):
        return f"get_ipython().{'getoutput' if is_captured else 'system'}({text[1:]!r})"
    magic = _LINE_MAGIC.match(text)
    if magic is None:
        return None
    return f"get_ipython().run_line_magic({magic['name']!r}, {(magic['line'] or '').rstrip()!r})"


class _ReaderState:
    """State of a reader of Python after a line: in a long string, in brackets, or after a backslash."""

    def __init__(self) -> None:
        self.quote = ""
        self.depth = 0
        self.goes_on = False

    @property
    def is_at_start(self) -> bool:
        return not (self.quote or self.depth or self.goes_on)


_TOKEN = re.compile(r"\\.|'''|\"\"\"|['\"#()\[\]{}]", re.DOTALL)


def _list_statement_starts(lines: list[str]) -> Iterator[int]:
    """Yield the indices of the lines on which a statement may begin."""
    state = _ReaderState()
    for index, line in enumerate(lines):
        if state.is_at_start:
            yield index
            # The caller may have rewritten the line by now, which makes it a complete statement.
            line = lines[index]
        _update_state(line, state)


def _update_state(line: str, state: _ReaderState) -> None:
    for match in _TOKEN.finditer(line):
        token = match[0]
        if state.quote:
            if token == state.quote:
                state.quote = ""
        elif token == "#":
            line = ""
            break
        elif token in ("'", '"', "'''", '"""'):
            state.quote = token
        elif token in "([{":
            state.depth += 1
        elif token in ")]}":
            state.depth = max(0, state.depth - 1)
    state.goes_on = line.endswith("\\") and not state.quote
    if len(state.quote) == 1 and not line.endswith("\\"):
        state.quote = ""
