"""What the reader in the sandbox found in the text of a part: where it has what the rules of a criterion name.

What is missing, and what should not be there, is judged in ``code.py``.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from submissions.criteria.code import SourceRules

#: What makes the robot speak.
SPEECH = ("say()", "speak()")
_UNREADABLE = "it cannot be read"


@dataclass(frozen=True, slots=True)
class MentionPlace:
    """A file beside the part, or a cell of a notebook (empty: the part itself), and a line."""

    file: str
    line: int

    def __str__(self) -> str:
        return f"line {self.line} of {self.file}" if self.file else f"line {self.line}"


@dataclass(frozen=True, slots=True)
class SourceAnswers:
    """Where a part has what each rule of a criterion names, in the order of the rules; None where it has it not.

    ``error``: why it cannot be read. ``unread``: a file beside it that cannot be, and why. ``doubts`` are places that
    can do more than their text shows.
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
    def read(cls, told: Any, criterion: SourceRules) -> SourceAnswers:
        """From what the reader in the sandbox returned, which is not believed to have any form."""
        try:
            name, why, line = told["unread"] or ("", "", None)
            where = f" (line {int(line)})" if line is not None else ""
            answers = (
                _places(told["uses"], criterion.uses),
                _places(told["avoids"], criterion.avoids),
                _places(told["in_loop"], criterion.in_loop),
                _places(told["defines"], criterion.defines),
                _places(told["shown"], SPEECH),
            )
            doubts = tuple(f"{_place(file, line)} has {str(what)[:80]}" for file, line, what in told["doubts"])
        except (LookupError, TypeError, ValueError, OverflowError):
            return cls(error=_UNREADABLE)
        if why and not name:
            return cls(error=f"{str(why)[:200]}{where}")
        return cls(*answers, doubts, "", f"{str(name)[:60]} cannot be read: {str(why)[:200]}" if name else "")


def _places(told: Any, rules: Sequence[str]) -> tuple[MentionPlace | None, ...]:
    """Raises one of Python's errors for what is no answer to each of the rules."""
    return tuple(None if place is None else _place(*place) for _, place in zip(rules, told, strict=True))


def _place(file: Any, line: Any) -> MentionPlace:
    return MentionPlace(str(file)[:60], int(line))
