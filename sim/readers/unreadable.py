"""The refusal that all readers share, and the bound on nesting that bracketed formats share.

Callers add the name of the file to the message; the sentence here is only the problem.
"""

from __future__ import annotations

from sim.errors import UsageError

#: No file that people or programs write for us comes near this depth; Python's own limit is ten times as far.
DEEPEST = 100
_TO_ROUND = bytes.maketrans(b"[]{}", b"()()")
_NO_BRACKETS = bytes(set(range(256)) - set(b"[]{}"))


class Unreadable(UsageError, ValueError):
    """Reading the data would take too much work or memory."""


class TooMany(Unreadable):
    """There are more values than are read."""


def check_depth(structure: str, deepest: int = DEEPEST) -> None:
    """Raise Unreadable if brackets in ``structure``, a text without its strings, are nested deeper than ``deepest``.

    Each pass removes all innermost pairs, so that the work is at most one pass for each level that is allowed.
    """
    if structure.count("[") + structure.count("{") <= deepest:
        return
    brackets = structure.encode("utf-8", "surrogatepass").translate(_TO_ROUND, _NO_BRACKETS)
    for _ in range(deepest):
        brackets = brackets.replace(b"()", b"")
    if b"()" in brackets or brackets.count(b"(") > deepest:
        raise Unreadable("it is nested too deeply")
