"""Reports as files in a folder: one HTML page a submission. Making the page is ``html.py``'s.

What makes and draws them is loaded when something is written: a folder is prepared before there is anything.
"""

from __future__ import annotations

import errno
import hashlib
import json
import os
import re
from collections import Counter
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from service.home import for_the_user
from service.language import ENGLISH, Language
from sim.errors import UsageError

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from service.grading.grade import Grade, TrialResult
    from submissions.submission import Submission

#: Of a name, in a file's name; a file system allows 255 for all of it.
_MOST_BYTES = 80


def file_stem(student: str, assignment: str = "") -> str:
    """What a student's files are called: no two names give the same, whatever is written into one folder.

    A space becomes a dash, and a dash two. A name from which more is lost, or that is too long, goes on with a hash.
    With ``assignment``, the student's files for this one.
    """
    plain = re.sub(r"[^\w.-]+", "-", student.replace("-", "--").replace(" ", "-"))
    short = plain.encode()[:_MOST_BYTES].decode(errors="ignore").strip("-.")
    again = re.sub("--?", lambda dashes: "-" if dashes[0] == "--" else " ", short)
    if again != student or short.casefold() == "index":
        short = f"{short or 'report'}~{hashlib.sha256(student.encode('utf-8', 'surrogatepass')).hexdigest()[:16]}"
    return f"{short}+{assignment}" if assignment else short


def file_stems(graded: Sequence[tuple[str, str]]) -> list[str]:
    """A stem for each (student, assignment); only a student with several assignments has them in it.

    Each pair may come once.
    """
    many = Counter(student for student, _ in graded)
    return [file_stem(student, assignment if many[student] > 1 else "") for student, assignment in graded]


def refused_stems(refused: Sequence[tuple[str, str]]) -> list[str]:
    """A stem for each (name it came under, student) that was refused.

    One student may be refused several times, and several for what they submitted together.
    """
    many = Counter(source for source, _ in refused)
    return [file_stem(f"{source} {student}" if many[source] > 1 else source, "refused") for source, student in refused]


def prepare_folder(folder: Path) -> None:
    """Make the folder, before any work is done for it. Raises UsageError when nothing can be written there."""
    try:
        with for_the_user():
            folder.mkdir(parents=True, exist_ok=True)
        reason = "" if os.access(folder, os.W_OK | os.X_OK) else os.strerror(errno.EACCES)
    except OSError as error:
        reason = "it is no folder" if folder.exists() else str(error.strerror)
    if reason:
        raise UsageError(f"the folder {folder} cannot be used for reports: {reason}")


def write_page(folder: Path, name: str, page: str) -> Path:
    """Write one page. Raises UsageError when the folder cannot be written to."""
    return write_file(folder, name, page.encode())


def write_replay(path: Path, replay: Mapping[str, Any], language: Language = ENGLISH) -> None:
    """Write the page that plays it, or its data as JSON if the file is called so. Raises UsageError if it cannot be."""
    from service.reports.html import replay_page

    page = json.dumps(replay, allow_nan=False) if path.suffix.lower() == ".json" else replay_page(replay, language)
    write_file(path.parent, path.name, page.encode())


def write_film(path: Path, trial: TrialResult, own_floors: Mapping[str, NDArray[np.uint8]]) -> None:
    """Write a film of the trial. Raises UsageError if it cannot be written."""
    from service.reports.film import film

    write_file(path.parent, path.name, film(trial, own_floors))


def write_file(folder: Path, name: str, data: bytes) -> Path:
    """Write one file. Raises UsageError when the folder cannot be written to."""
    path = folder / name
    try:
        with for_the_user():
            folder.mkdir(parents=True, exist_ok=True)
            path.write_bytes(data)
    except OSError as error:
        raise UsageError(f"{path} cannot be written: {error.strerror}") from error
    return path


def write_report(folder: Path, grade: Grade, submission: Submission, written: str, language: Language) -> Path:
    """Draw the plots of a grade and write the report, called after the student as the name was written; where it is."""
    from service.reports.html import report
    from service.reports.plots.drawn import draw_all
    from service.reports.view import student_view
    from submissions.diagram_cells import diagrams_in

    plots = draw_all(grade, cells=diagrams_in(submission.notebook).cells)
    page = report(student_view(grade, language=language), plots, submission)
    return write_page(folder, f"{file_stem(written)}.html", page)
