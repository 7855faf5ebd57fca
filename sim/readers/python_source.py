"""Python parser with limits on tokens, parts of a name, and braces.

Each token becomes an object of several hundred bytes. CPython keeps every prefix of the dotted name in an import, and
reads an f-string from its start again for each expression in braces.

Robomark's own processes use it to inspect source, never to run it. Student code runs inside the sandbox.
"""

from __future__ import annotations

import ast
import re

from sim.readers.reader_errors import TooManyValuesError, UnreadableDataError

MAX_TOKENS = 200_000
MAX_NAME_PARTS = 100
#: Maximum of the number of braces times the length of the text. Parsing that much takes about a quarter of a second.
MAX_BRACE_WORK = 500_000_000
_TOKEN = re.compile(r"\w++|[^\w\s]")
# Some characters of names, such as combining marks, are not in \w.
_DOTTED_NAME = re.compile(r"(?<![\w\x80-\U0010ffff])[\w\x80-\U0010ffff]++(?:[\s\\]*+\.[\s\\]*+[\w\x80-\U0010ffff]++)++")


def parse_module(text: str) -> ast.Module:
    """Parse a module and return its syntax tree.

    Raises:
        SyntaxError: The text is not Python.
        UnreadableDataError: Parsing would take too much work.
    """
    if len(text) > MAX_TOKENS and sum(1 for _ in _TOKEN.finditer(text)) > MAX_TOKENS:
        raise TooManyValuesError("it has more than %(most)s tokens", most=MAX_TOKENS)
    if any(name[0].count(".") >= MAX_NAME_PARTS for name in _DOTTED_NAME.finditer(text)):
        raise UnreadableDataError("it has a name of more than %(most)s parts", most=MAX_NAME_PARTS)
    if text.count("{") * len(text) > MAX_BRACE_WORK:
        raise TooManyValuesError("it has too many braces")
    try:
        return ast.parse(text)
    except (RecursionError, MemoryError):
        raise UnreadableDataError("it is nested too deeply") from None
    except ValueError:
        raise UnreadableDataError("it has a character that Python source cannot have") from None
