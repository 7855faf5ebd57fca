"""One submission and what it is to be marked against, as it was found; nothing of it is stored or graded yet."""

from __future__ import annotations

from dataclasses import dataclass
from datetime import datetime

from submissions.assignment.definition import Assignment
from submissions.submission import Submission


@dataclass(frozen=True, slots=True)
class GradingRequest:
    """One submission and what it is marked against; ``source`` is the name it came under."""

    submission: Submission
    assignment: Assignment
    source: str
    submitted_at: datetime | None = None  # by the student, where anybody said
    written: str = ""  # the student, as the file or folder has it, where that is not the normal form

    @property
    def student(self) -> str:
        """As it was written."""
        return self.written or self.submission.student
