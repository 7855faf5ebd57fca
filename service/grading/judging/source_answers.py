"""Results of the sandboxed source reader: the places in a part's source that a criterion's rules name.

``code.py`` judges what is missing and what should not be there.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from sim.sentences import Sentence
from submissions.criteria.code import SourceRules

#: The calls that make the robot speak.
SPEECH = ("say()", "speak()")
_UNREADABLE_SOURCE = Sentence("it cannot be read")


@dataclass(frozen=True, slots=True)
class MentionPlace:
    """A file beside the part, or a cell of a notebook (empty: the part itself), and a line."""

    file: str
    line: int

    def describe(self) -> str:
        """Return the place as ``line 3 of helper.py``."""
        if not self.file:
            return Sentence("line %(line)s", line=self.line)
        return Sentence("line %(line)s of %(file)s", line=self.line, file=self.file)


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
            error: str = str(reason)[:200]
            if line is not None:
                error = Sentence("%(error)s (line %(line)s)", error=error, line=int(line))
            answers = (
                _parse_places(result["uses"], criterion.uses),
                _parse_places(result["avoids"], criterion.avoids),
                _parse_places(result["in_loop"], criterion.in_loop),
                _parse_places(result["defines"], criterion.defines),
                _parse_places(result["shown"], SPEECH),
            )
            doubts = tuple(
                Sentence("%(place)s has %(code)s", place=_parse_place(file, line).describe(), code=str(what)[:80])
                for file, line, what in result["doubts"]
            )
        except (LookupError, TypeError, ValueError, OverflowError):
            return cls(error=_UNREADABLE_SOURCE)
        if reason and not name:
            return cls(error=error)
        if not name:
            return cls(*answers, doubts)
        unread = Sentence("%(file)s cannot be read: %(reason)s", file=str(name)[:60], reason=str(reason)[:200])
        return cls(*answers, doubts, unread=unread)


def _parse_places(positions: Any, rules: Sequence[str]) -> tuple[MentionPlace | None, ...]:
    """Parse the places of each rule. Raises a standard Python exception if the data is malformed."""
    return tuple(None if place is None else _parse_place(*place) for _, place in zip(rules, positions, strict=True))


def _parse_place(file: Any, line: Any) -> MentionPlace:
    return MentionPlace(str(file)[:60], int(line))
