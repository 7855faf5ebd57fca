"""Request to grade a submission against an assignment. Nothing has been stored or graded yet."""

from __future__ import annotations

from dataclasses import dataclass, replace
from datetime import datetime
from typing import TYPE_CHECKING

from submissions.student_identity import UNKNOWN_STUDENT, Student
from submissions.submission import Submission

if TYPE_CHECKING:
    from submissions.assignment.definition import Assignment


@dataclass(frozen=True, slots=True)
class GradingRequest:
    """A submission and its assignment; ``source`` is the name under which it was submitted."""

    submission: Submission
    assignment: Assignment
    source: str
    submitted_at: datetime | None = None  # time of submission by the student, if known
    listed_student: Student = UNKNOWN_STUDENT  # as written in the source, if known

    @property
    def student(self) -> Student:
        """The student's id as written."""
        return (
            self.listed_student if self.listed_student.id else replace(self.listed_student, id=self.submission.student)
        )
