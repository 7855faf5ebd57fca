"""Python parser with a limit on tokens, because each token becomes an object of several hundred bytes.

Robomark's own processes use it to inspect source, never to run it. Student code runs inside the sandbox.
"""

from __future__ import annotations

import ast
import re

from sim.readers.reader_errors import TooManyValuesError, UnreadableDataError

MAX_TOKENS = 200_000
_TOKEN = re.compile(r"\w++|[^\w\s]")


def parse_module(text: str) -> ast.Module:
    """Parse a module and return its syntax tree.

    Raises:
        SyntaxError: The text is not Python.
        UnreadableDataError: Parsing would take too much work.
    """
    if len(text) > MAX_TOKENS and sum(1 for _ in _TOKEN.finditer(text)) > MAX_TOKENS:
        raise TooManyValuesError("it has more than %(most)s tokens", most=MAX_TOKENS)
    try:
        return ast.parse(text)
    except (RecursionError, MemoryError):
        raise UnreadableDataError("it is nested too deeply") from None
    except ValueError:
        raise UnreadableDataError("it has a character that Python source cannot have") from None
