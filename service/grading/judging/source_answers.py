"""Results of the sandboxed source reader: the places in a part's source that a criterion's rules name.

``code.py`` judges what is missing and what should not be there.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from submissions.criteria.code import SourceRules

#: The calls that make the robot speak.
SPEECH = ("say()", "speak()")
_UNREADABLE_SOURCE = "it cannot be read"


@dataclass(frozen=True, slots=True)
class MentionPlace:
    """A file beside the part, or a cell of a notebook (empty: the part itself), and a line."""

    file: str
    line: int

    def __str__(self) -> str:
        return f"line {self.line} of {self.file}" if self.file else f"line {self.line}"


@dataclass(frozen=True, slots=True)
class SourceAnswers:
    """The places that match each rule of a criterion, in the order of the rules; None without a match.

    ``error`` says why the part cannot be read. ``unread`` is a neighbouring file that cannot be read, with the reason.
    ``doubts`` are places that can do more than their text shows.
    """

    uses: tuple[MentionPlace | None, ...] = ()
    avoids: tuple[MentionPlace | None, ...] = ()
    in_loop: tuple[MentionPlace | None, ...] = ()
    defines: tuple[MentionPlace | None, ...] = ()
    speech: tuple[MentionPlace | None, ...] = ()
    doubts: tuple[str, ...] = ()
    error: str = ""
    unread: str = ""

    @classmethod
    def read(cls, result: Any, criterion: SourceRules) -> SourceAnswers:
        """Parse the result of the sandboxed reader. Its form is not trusted."""
        try:
            name, reason, line = result["unread"] or ("", "", None)
            line_clause = f" (line {int(line)})" if line is not None else ""
            answers = (
                _parse_places(result["uses"], criterion.uses),
                _parse_places(result["avoids"], criterion.avoids),
                _parse_places(result["in_loop"], criterion.in_loop),
                _parse_places(result["defines"], criterion.defines),
                _parse_places(result["shown"], SPEECH),
            )
            doubts = tuple(f"{_parse_place(file, line)} has {str(what)[:80]}" for file, line, what in result["doubts"])
        except (LookupError, TypeError, ValueError, OverflowError):
            return cls(error=_UNREADABLE_SOURCE)
        if reason and not name:
            return cls(error=f"{str(reason)[:200]}{line_clause}")
        return cls(*answers, doubts, "", f"{str(name)[:60]} cannot be read: {str(reason)[:200]}" if name else "")


def _parse_places(positions: Any, rules: Sequence[str]) -> tuple[MentionPlace | None, ...]:
    """Parse the places of each rule. Raises a standard Python exception if the data is malformed."""
    return tuple(None if place is None else _parse_place(*place) for _, place in zip(rules, positions, strict=True))


def _parse_place(file: Any, line: Any) -> MentionPlace:
    return MentionPlace(str(file)[:60], int(line))
