"""One submission and what it is to be marked against, as it was found; nothing of it is stored or graded yet."""

from __future__ import annotations

from dataclasses import dataclass, replace
from datetime import datetime
from typing import TYPE_CHECKING

from submissions.student_identity import NOBODY, Student
from submissions.submission import Submission

if TYPE_CHECKING:
    from submissions.assignment.definition import Assignment


@dataclass(frozen=True, slots=True)
class GradingRequest:
    """One submission and what it is marked against; ``source`` is the name it came under."""

    submission: Submission
    assignment: Assignment
    source: str
    submitted_at: datetime | None = None  # by the student, where anybody said
    whose: Student = NOBODY  # as it is written there, where anybody said

    @property
    def student(self) -> Student:
        """Whose it is, by an id as it was written."""
        return self.whose if self.whose.id else replace(self.whose, id=self.submission.student)
