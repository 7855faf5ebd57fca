"""A program's text with its syntax tree, and edits of the text at the positions of the tree's nodes.

Edits replace one stretch of the text, so comments and layout stay as they are. Nothing is run.
"""

from __future__ import annotations

import ast
import math
import re
import warnings
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise

from sim.errors import UsageError
from sim.readers.python_source import parse_module
from submissions.magics import comment_out_magic

#: The line ends of Python source. ``str.splitlines`` knows more, which are ordinary characters in Python.
_LINE_END = re.compile(r"\r\n|\r|\n")
_WORD_END, _WORD_START = re.compile(r"\w\Z"), re.compile(r"\w")
#: Nodes whose inner positions are unreliable in Python 3.11, or whose numbers and texts are not values.
_OPAQUE = (ast.JoinedStr, ast.pattern)


@dataclass(frozen=True, slots=True)
class Edit:
    """The replacement of ``text[start:end]``, in characters."""

    start: int
    end: int
    new: str


@dataclass(frozen=True, slots=True)
class NumberLiteral:
    """A number in the text, with its minus sign if it has one."""

    node: ast.expr
    value: int | float
    start: int
    end: int
    line: int


class SourceTree:
    """The syntax tree of a text. Magic lines are comments. Positions are offsets in characters.

    Raises:
        UsageError: The text is not Python, or parsing it would take too much work.
    """

    def __init__(self, text: str) -> None:
        self.text = text
        self.module = _parse(text)
        self._line_starts = [0, *(match.end() for match in _LINE_END.finditer(text))]
        self._parents = {child: parent for parent in ast.walk(self.module) for child in ast.iter_child_nodes(parent)}

    @cached_property
    def nodes(self) -> tuple[ast.AST, ...]:
        """The nodes with reliable positions in the order of the text, outer ones first."""
        return tuple(self._walk())

    @cached_property
    def numbers(self) -> tuple[NumberLiteral, ...]:
        """The numbers of the text, in its order."""
        return tuple(self._collect_numbers())

    def find_parent(self, node: ast.AST) -> ast.AST | None:
        """Return the enclosing node; None for the module."""
        return self._parents.get(node)

    def iterate_ancestors(self, node: ast.AST) -> Iterator[ast.AST]:
        """Yield the enclosing nodes, the innermost first."""
        parent = self._parents.get(node)
        while parent is not None:
            yield parent
            parent = self._parents.get(parent)

    def locate(self, node: ast.expr | ast.stmt) -> tuple[int, int]:
        """Return the start and the end of a node."""
        last_line, last_column = node.end_lineno or node.lineno, node.end_col_offset or 0  # parsed nodes have an end
        return self._to_offset(node.lineno, node.col_offset), self._to_offset(last_line, last_column)

    def cut(self, node: ast.expr | ast.stmt) -> str:
        """Return the text of a node."""
        start, end = self.locate(node)
        return self.text[start:end]

    def find_line(self, offset: int) -> int:
        """Return the number of the line, from 1, at an offset."""
        return sum(start <= offset for start in self._line_starts)

    def find_line_start(self, line: int) -> int:
        """Return the offset at which a line, from 1, starts."""
        return self._line_starts[line - 1]

    def cut_line(self, line: int) -> str:
        """Return the text of a line, from 1."""
        starts = [*self._line_starts, len(self.text)]
        return self.text[starts[line - 1] : starts[line]]

    def replace(self, node: ast.expr | ast.stmt, new: str) -> Edit:
        """Return the edit that replaces a node."""
        return Edit(*self.locate(node), new)

    def exchange(self, first: ast.expr | ast.stmt, second: ast.expr | ast.stmt) -> Edit:
        """Return the edit that exchanges two nodes, of which ``first`` ends before ``second``."""
        start, middle = self.locate(first)
        last, end = self.locate(second)
        return Edit(start, end, self.text[last:end] + self.text[middle:last] + self.text[start:middle])

    def replace_between(self, first: ast.expr, second: ast.expr, token: re.Pattern[str], new: str) -> Iterator[Edit]:
        """Yield the edit that replaces the first token of this pattern between two nodes; none if there is no token."""
        start, end = self.locate(first)[1], self.locate(second)[0]
        for match in re.finditer(rf"#[^\r\n]*|(?P<token>{token.pattern})", self.text[start:end]):
            if match["token"] is not None:
                yield Edit(start + match.start(), start + match.end(), new)
                return

    def apply(self, edit: Edit) -> str:
        """Return the changed text. Words that would join are separated by a space."""
        before, after = self.text[: edit.start], self.text[edit.end :]
        new = edit.new
        if _WORD_END.search(before) and _WORD_START.match(new):
            new = f" {new}"
        if _WORD_END.search(new) and _WORD_START.match(after):
            new = f"{new} "
        return before + new + after

    def iterate_blocks(self) -> Iterator[list[ast.stmt]]:
        """Yield the lists of statements: the module, and the bodies and branches of compound statements."""
        for node in (self.module, *self.nodes):
            for name in ("body", "orelse", "finalbody"):
                block = getattr(node, name, None)
                if isinstance(block, list) and block and isinstance(block[0], ast.stmt):
                    yield block

    def iterate_statement_pairs(self) -> Iterator[tuple[ast.stmt, ast.stmt]]:
        """Yield each two statements that follow each other in a block."""
        for block in self.iterate_blocks():
            yield from pairwise(block)

    def _walk(self) -> Iterator[ast.AST]:
        stack: list[ast.AST] = [self.module]
        while stack:
            node = stack.pop()
            if node is not self.module:
                yield node
            if not isinstance(node, _OPAQUE):
                stack += reversed(list(ast.iter_child_nodes(node)))

    def _to_offset(self, line: int, column: int) -> int:
        """Return the offset for a line, from 1, and a column in UTF-8 bytes."""
        start = self._line_starts[line - 1]
        # A character has at most four bytes, and the column is within the line.
        line_text = self.text[start : start + column]
        if line_text.isascii():
            return start + column
        return start + len(line_text.encode("utf-8", "surrogatepass")[:column].decode("utf-8", "surrogatepass"))

    def _collect_numbers(self) -> Iterator[NumberLiteral]:
        signed_numbers: set[ast.AST] = set()
        for node in self.nodes:
            if isinstance(node, ast.UnaryOp) and isinstance(node.op, ast.USub):
                value = get_number(node.operand)
                if value is not None:
                    signed_numbers.add(node.operand)
                    yield self._build_number(node, -value)
            elif isinstance(node, ast.expr) and node not in signed_numbers:
                value = get_number(node)
                if value is not None:
                    yield self._build_number(node, value)

    def _build_number(self, node: ast.expr, value: float) -> NumberLiteral:
        start, end = self.locate(node)
        return NumberLiteral(node, value, start, end, self.find_line(start))


def get_number(node: ast.AST) -> int | float | None:
    """Return the value of a constant that is a finite number; None for other nodes."""
    value = node.value if isinstance(node, ast.Constant) else None
    if isinstance(value, bool) or not isinstance(value, int | float) or not math.isfinite(value):
        return None
    return value


def get_text(node: ast.AST | None) -> str | None:
    """Return the value of a constant that is a text; None for other nodes."""
    return node.value if isinstance(node, ast.Constant) and isinstance(node.value, str) else None


def get_called_name(node: ast.AST | None) -> str:
    """Return the last name of the called function, ``sleep`` for ``time.sleep(1)``; empty if there is no call."""
    match node:
        case ast.Call(func=ast.Name(id=name)) | ast.Call(func=ast.Attribute(attr=name)):
            return name
    return ""


def is_python(text: str) -> bool:
    """Return whether the text, without its magic lines, is Python."""
    try:
        _parse(text)
    except UsageError:
        return False
    return True


def _parse(text: str) -> ast.Module:
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # of Python, about the student's code
            return parse_module(comment_out_magic(text))
    except SyntaxError as error:
        raise UsageError("line %(line)s is not Python", line=error.lineno or 0) from None
