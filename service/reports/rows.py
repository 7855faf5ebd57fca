"""The rows of a table of submissions: whose each is and its grade, or why it has none.

What a table shows of a grade is its format's; which rows there are is for whoever has them.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace
from typing import Generic, TypeVar

from service.grading.grade import Grade
from submissions.student_identity import Student

_V = TypeVar("_V")
_W = TypeVar("_W")


@dataclass(frozen=True, slots=True)
class TableRow(Generic[_V]):
    """One submission. ``grade`` is what is shown of its grade, None where it has none; ``reason`` says why.

    A grade has a reason as well where a part was not submitted. ``refused`` is what could not be taken in, so that no
    grade will come. ``told`` is the reason in words for its student, where those are others; a row that is
    ``for_staff`` is shown to no student.
    """

    student: Student
    source: str  # the name it came under
    assignment: str
    grade: _V | None = None
    reason: str = ""
    refused: bool = False
    told: str = ""
    for_staff: bool = False

    @property
    def who(self) -> str:
        """The student's id; what the submission is called, where nobody knows whose it is."""
        return self.student.id or self.source

    def shown(self, view: Callable[[_V], _W]) -> TableRow[_W]:
        """The row with what ``view`` leaves of its grade."""
        grade = None if self.grade is None else view(self.grade)
        return TableRow(
            self.student, self.source, self.assignment, grade, self.reason, self.refused, self.told, self.for_staff
        )


def rows_for_students(rows: Iterable[TableRow[_V]]) -> list[TableRow[_V]]:
    """The rows as students may read them in a gradebook: none that is for staff alone, and no fault of ours."""
    return [replace(row, reason=row.told or row.reason) for row in rows if not row.for_staff]


@dataclass(frozen=True, slots=True)
class ReportPage:
    """The report of one row, as its student may read it."""

    row: TableRow[Grade]
    html: str


def missing_words(missing: str) -> str:
    """That a part was not submitted; empty where none is missing."""
    return f"there is no {missing}; the rest was graded" if missing else ""
