"""Load an assignment and a submission, and grade the one against the other, as the command ``grade`` does."""

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
from service.home_secret import secret_here
from service.settings import load_settings
from submissions.assignment.definition import Assignment
from submissions.assignment.reader import find_assignment
from submissions.bundle import read_submission
from submissions.submission import Submission


def load_assignment(name_or_folder: str | os.PathLike[str]) -> Assignment:
    """The assignment of the catalogue with this id, or the one in a folder.

    Raises:
        UsageError: there is none, or its files have mistakes.
    """
    return find_assignment(name_or_folder)


def load_submission(path: str | os.PathLike[str], assignment: Assignment, *, student: str | None = None) -> Submission:
    """What a student submitted to an assignment: a ``.py`` file, a notebook, a folder or a ``.zip``.

    Args:
        path: Where the submission is.
        assignment: What it is marked against, which says which parts it must have.
        student: Who submitted it; the name of the file or folder unless given.

    Raises:
        UsageError: it cannot be read, or lacks a part that the assignment asks for.
    """
    return read_submission(Path(path), student=student, asked=assignment.parts)


class Grader(AbstractContextManager["Grader"]):
    """Grades many submissions with the same sandboxed processes, which take a second to start.

    Close it, or use it in a ``with`` statement.
    """

    def __init__(self) -> None:
        self._runner = TrialRunner(Sandboxes())
        self._secret = secret_here(load_settings())

    def grade(self, submission: Submission, assignment: Assignment) -> Grade:
        """The grade of a submission, with every trial's recording.

        Raises:
            UsageError: the submission has no part that the assignment asks for.
            HostError: this machine cannot run student code safely, or fails.
        """
        return grader.grade(submission, assignment, secret=self._secret, runner=self._runner)

    def close(self) -> None:
        """End the processes."""
        self._runner.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, where: TracebackType | None, /
    ) -> None:
        self.close()


def grade(submission: Submission, assignment: Assignment) -> Grade:
    """The grade of one submission; a ``Grader`` is quicker for many.

    Raises:
        UsageError: the submission has no part that the assignment asks for.
        HostError: this machine cannot run student code safely, or fails.
    """
    with Grader() as own:
        return own.grade(submission, assignment)
