"""Recording of the executed statements of a student's files, each at its first execution.

A table lookup is inserted before each statement. It reports statements that are not in the table yet. Lines don't
change.
"""

from __future__ import annotations

import ast
import sys
from collections.abc import Callable, Iterator
from types import CodeType
from typing import Any

from .frames import Frame

_TABLE = "__ran__"
_MAX_LINE_LENGTH = 1_000_000
_RECURSION_LIMIT = 30_000
_BLOCK_FIELDS = ("body", "orelse", "finalbody")


class StatementWatch:
    """Compiles files and sends a frame for each executed statement. ``main`` is the main file."""

    def __init__(self, send: Callable[[Frame], None], main: str) -> None:
        self._send = send
        self._main = main

    def compile(self, text: str, name: str, namespace: dict[str, Any]) -> CodeType:
        """Compile a whole file to run in ``namespace``. The file must compile without changes."""
        namespace[_TABLE] = _StatementTable(self._send, None if name == self._main else name)
        limit = sys.getrecursionlimit()
        # Compiling a syntax tree needs deeper recursion than compiling its text.
        sys.setrecursionlimit(_RECURSION_LIMIT)
        try:
            tree = ast.parse(text, name)
            for block in list(_list_blocks(tree)):
                block[:] = [each for statement in block for each in (*_build_lookup(statement), statement)]
            return compile(tree, name, "exec", dont_inherit=True)
        finally:
            sys.setrecursionlimit(limit)


class _StatementTable(dict[int, None]):
    """The executed statements of one file, by line and column in one number."""

    def __init__(self, send: Callable[[Frame], None], file: str | None) -> None:
        self._send, self._file = send, file

    def __missing__(self, position: int) -> None:
        self[position] = None
        line, column = divmod(position, _MAX_LINE_LENGTH)
        self._send({"do": "ran", "file": self._file, "line": line, "column": column})


def _list_blocks(tree: ast.Module) -> Iterator[list[ast.stmt]]:
    for node in ast.walk(tree):
        for name in _BLOCK_FIELDS:
            block = getattr(node, name, None)
            if isinstance(block, list):
                yield block


def _build_lookup(statement: ast.stmt) -> Iterator[ast.stmt]:
    """Yield a lookup for a statement, except where no statement may come before it."""
    match statement:
        case ast.ImportFrom(module="__future__") | ast.Expr(value=ast.Constant(value=str())):
            return
    position = ast.Constant(statement.lineno * _MAX_LINE_LENGTH + statement.col_offset)
    lookup = ast.Expr(ast.Subscript(ast.Name(_TABLE, ast.Load()), position, ast.Load()))
    for node in ast.walk(lookup):
        ast.copy_location(node, statement)
    yield lookup
