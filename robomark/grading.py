"""Load assignments and submissions and grade them, as the command ``grade`` does."""

from __future__ import annotations

import os
from contextlib import AbstractContextManager
from pathlib import Path
from types import TracebackType
from typing import Self

from responders.sandbox.manager import Sandboxes
from service.grading import grader
from service.grading.grade import Grade
from service.grading.trial_runner import TrialRunner
from service.home_secret import load_home_secret
from service.settings import load_settings
from submissions.assignment.definition import Assignment
from submissions.assignment.reader import find_assignment
from submissions.bundle import read_submission
from submissions.submission import Submission


def load_assignment(name_or_folder: str | os.PathLike[str]) -> Assignment:
    """Load an assignment from the catalogue, by its id, or from a folder.

    Raises:
        UsageError: If it doesn't exist, or its files have errors.
    """
    return find_assignment(name_or_folder)


def load_submission(path: str | os.PathLike[str], assignment: Assignment, *, student: str | None = None) -> Submission:
    """Load a student's submission to an assignment: a ``.py`` file, a notebook, a folder or a ``.zip``.

    Args:
        path: The path of the submission.
        assignment: The assignment, which defines the required parts.
        student: The student's name. By default, the name of the file or folder.

    Raises:
        UsageError: If it can't be read, or lacks a part that the assignment requires.
    """
    return read_submission(Path(path), student=student, required_parts=assignment.parts)


class Grader(AbstractContextManager["Grader"]):
    """Grades many submissions with the same sandboxed processes, which take a second to start.

    Call ``close`` when done, or use it in a ``with`` statement.
    """

    def __init__(self) -> None:
        self._runner = TrialRunner(Sandboxes())
        self._secret = load_home_secret(load_settings())

    def grade(self, submission: Submission, assignment: Assignment) -> Grade:
        """Grade a submission and return the grade, with the recording of every trial.

        Raises:
            UsageError: If the submission has no part that the assignment requires.
            HostError: If this machine can't run student code safely, or fails.
        """
        return grader.grade(submission, assignment, secret=self._secret, runner=self._runner)

    def close(self) -> None:
        """Stop the processes."""
        self._runner.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, traceback: TracebackType | None, /
    ) -> None:
        self.close()


def grade(submission: Submission, assignment: Assignment) -> Grade:
    """Grade one submission and return the grade. For many submissions, a ``Grader`` is faster.

    Raises:
        UsageError: If the submission has no part that the assignment requires.
        HostError: If this machine can't run student code safely, or fails.
    """
    with Grader() as grader:
        return grader.grade(submission, assignment)
