"""Reports as files in a folder: one HTML page a hand-in. Making the page is ``html.py``'s."""

from __future__ import annotations

import errno
import os
import re
from pathlib import Path

from service.grading.grade import Grade
from service.reports.html import student_report
from service.reports.plots import draw_all
from sim.errors import UsageError
from submissions.submission import Submission


def file_name(student: str) -> str:
    """A file name for a student's report: letters, digits, dots and dashes of the name, and nothing else."""
    plain = re.sub(r"[^\w.-]+", "-", student).strip("-._")[:80]
    return f"{plain or 'report'}.html"


def prepare_folder(folder: Path) -> None:
    """Make the folder, before any work is done for it. Raises UsageError when nothing can be written there."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
        reason = "" if os.access(folder, os.W_OK | os.X_OK) else os.strerror(errno.EACCES)
    except OSError as error:
        reason = "it is no folder" if folder.exists() else str(error.strerror)
    if reason:
        raise UsageError(f"the folder {folder} cannot be used for reports: {reason}")


def write_page(folder: Path, name: str, page: str) -> Path:
    """Write one page. Raises UsageError when the folder cannot be written to."""
    path = folder / name
    try:
        folder.mkdir(parents=True, exist_ok=True)
        path.write_text(page, encoding="utf-8")
    except OSError as error:
        raise UsageError(f"{path} cannot be written: {error.strerror}") from error
    return path


def write_report(folder: Path, grade: Grade, submission: Submission | None = None) -> Path:
    """Draw the plots of a grade and write the student's report; where it is."""
    page = student_report(grade, draw_all(grade), submission)
    return write_page(folder, file_name(grade.student), page)
