"""Records of a batch for its moderation sheet: versions, overrides with withdrawn ones, appeals, the head of the log.

The store reads them, and ``reports/moderation.py`` shows them.
"""

from __future__ import annotations

from dataclasses import dataclass
from datetime import datetime
from decimal import Decimal


@dataclass(frozen=True, slots=True)
class SheetVersion:
    """The versions that made the grades of ``count`` submissions."""

    assignment: str  # hash of the assignment's folder
    grader: str  # release
    grader_sha256: str
    sandbox: str
    count: int


@dataclass(frozen=True, slots=True)
class SheetOverride:
    """A criterion that staff adjusted. ``graded`` is None if it could not be judged, ``marks`` if it is excused.

    ``title`` is that of the criterion, or its id if the grade no longer has it.
    """

    student: str
    title: str
    graded: Decimal | None
    marks: Decimal | None
    reason: str
    actor: str
    made_at: datetime
    withdrawn_at: datetime | None


@dataclass(frozen=True, slots=True)
class SheetAppeal:
    """An appeal; ``answer`` is None while it is open."""

    student: str
    text: str
    asked_at: datetime
    answer: str | None
    actor: str | None
    answered_at: datetime | None


@dataclass(frozen=True, slots=True)
class SheetLogHead:
    """The newest head of the log of statements that was written to be filed."""

    size: int
    root_sha256: str
    made_at: datetime
