"""The rows of a table of submissions: each student and grade, or the reason why there is none.

The formats decide what to show of a grade, and the callers which rows there are.
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
    """One submission. ``grade`` is the visible grade, or None; ``reason`` says why there is none.

    A grade also has a reason if a part was not submitted. ``refused`` marks a rejected submission, which will not get a
    grade. ``student_reason`` is the reason for the student, if it differs. A row that is ``for_staff`` is not shown to
    students.
    """

    student: Student
    source: str  # its original name
    assignment: str
    grade: _V | None = None
    reason: str = ""
    refused: bool = False
    student_reason: str = ""
    for_staff: bool = False

    @property
    def who(self) -> str:
        """The student's id, or the name of the submission if the student is unknown."""
        return self.student.id or self.source

    def apply_view(self, view: Callable[[_V], _W]) -> TableRow[_W]:
        """Return the row with its grade as seen through ``view``."""
        grade = None if self.grade is None else view(self.grade)
        return TableRow(
            self.student,
            self.source,
            self.assignment,
            grade,
            self.reason,
            self.refused,
            self.student_reason,
            self.for_staff,
        )


def select_student_rows(rows: Iterable[TableRow[_V]]) -> list[TableRow[_V]]:
    """Return the rows for students in a gradebook, without rows for staff only and without internal errors."""
    return [replace(row, reason=row.student_reason or row.reason) for row in rows if not row.for_staff]


@dataclass(frozen=True, slots=True)
class ReportPage:
    """The report of one row, as its student may read it."""

    row: TableRow[Grade]
    html: str


def describe_missing_part(missing: str) -> str:
    """Return a note that a part was not submitted; empty if none is missing."""
    return f"there is no {missing}; the rest was graded" if missing else ""
