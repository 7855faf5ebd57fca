"""Error class and nesting limit shared by the readers.

The message describes the problem. Callers add the file name.
"""

from __future__ import annotations

from sim.errors import UsageError

#: Far deeper than any real file; Python's own limit is ten times as high.
MAX_DEPTH = 100
_TO_ROUND = bytes.maketrans(b"[]{}", b"()()")
_NO_BRACKETS = bytes(set(range(256)) - set(b"[]{}"))


class UnreadableDataError(UsageError, ValueError):
    """Reading the data would take too much work or memory."""


class TooManyValuesError(UnreadableDataError):
    """The data contain more values than the limit."""


class TooLongNumberError(UnreadableDataError):
    """A number has more digits than Python converts."""

    def __init__(self) -> None:
        super().__init__("it has a number that is too long")


def check_depth(structure: str) -> None:
    """Raise UnreadableDataError if brackets are nested deeper than ``MAX_DEPTH``. ``structure`` contains no strings.

    Each pass removes all innermost pairs, so the number of passes is limited by the allowed depth.
    """
    if structure.count("[") + structure.count("{") <= MAX_DEPTH:
        return
    brackets = structure.encode("utf-8", "surrogatepass").translate(_TO_ROUND, _NO_BRACKETS)
    for _ in range(MAX_DEPTH):
        brackets = brackets.replace(b"()", b"")
    if b"()" in brackets or brackets.count(b"(") > MAX_DEPTH:
        raise UnreadableDataError("it is nested too deeply")
