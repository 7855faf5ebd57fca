"""Reports as files in a folder: one HTML page per submission. ``html.py`` makes the pages.

The rendering modules are loaded on first use, because the folder is prepared before there is anything to write.
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

from service.home import user_permissions
from service.language import ENGLISH, Language
from sim.errors import UsageError

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from service.grading.grade import Grade, TrialResult
    from submissions.submission import Submission

#: The longest name within a file name, in bytes. A file system allows 255 in total.
_MAX_BYTES = 80


def build_file_stem(student: str, assignment: str = "") -> str:
    """Return the stem of a student's file names. Different names give different stems in one folder.

    A space becomes a dash, and a dash two. A name that loses more, or is too long, gets a hash. With ``assignment``,
    the stem is for the student's files of that assignment.
    """
    safe_name = re.sub(r"[^\w.-]+", "-", student.replace("-", "--").replace(" ", "-"))
    stem = safe_name.encode()[:_MAX_BYTES].decode(errors="ignore").strip("-.")
    restored_name = re.sub("--?", lambda dashes: "-" if dashes[0] == "--" else " ", stem)
    if restored_name != student or stem.casefold() == "index":
        stem = f"{stem or 'report'}~{hashlib.sha256(student.encode('utf-8', 'surrogatepass')).hexdigest()[:16]}"
    return f"{stem}+{assignment}" if assignment else stem


def build_file_stems(submissions: Sequence[tuple[str, str]]) -> list[str]:
    """Return a stem for each (student, assignment). It contains the assignment only if the student has several.

    Each pair may come once.
    """
    counts = Counter(student for student, _ in submissions)
    return [build_file_stem(student, assignment if counts[student] > 1 else "") for student, assignment in submissions]


def build_refused_stems(rejections: Sequence[tuple[str, str]]) -> list[str]:
    """Return a stem for each (original name, student) that was rejected.

    One student may be rejected several times, and several students for one joint submission.
    """
    counts = Counter(source for source, _ in rejections)
    return [
        build_file_stem(f"{source} {student}" if counts[source] > 1 else source, "refused")
        for source, student in rejections
    ]


def prepare_folder(folder: Path) -> None:
    """Create the folder before other work is done.

    Raises:
        UsageError: It cannot be written to.
    """
    try:
        with user_permissions():
            folder.mkdir(parents=True, exist_ok=True)
        reason = "" if os.access(folder, os.W_OK | os.X_OK) else os.strerror(errno.EACCES)
    except OSError as error:
        reason = "it is no folder" if folder.exists() else str(error.strerror)
    if reason:
        raise UsageError(f"the folder {folder} cannot be used for reports: {reason}")


def write_page(folder: Path, name: str, page: str) -> Path:
    """Write one page.

    Raises:
        UsageError: The folder cannot be written to.
    """
    return write_file(folder, name, page.encode())


def write_replay(path: Path, replay: Mapping[str, Any], language: Language = ENGLISH) -> None:
    """Write the replay page, or its data if the file name ends in .json.

    Raises:
        UsageError: The file cannot be written.
    """
    from service.reports.html import render_replay_page

    page = (
        json.dumps(replay, allow_nan=False) if path.suffix.lower() == ".json" else render_replay_page(replay, language)
    )
    write_file(path.parent, path.name, page.encode())


def write_film(path: Path, trial: TrialResult, own_floors: Mapping[str, NDArray[np.uint8]]) -> None:
    """Write an animation of the trial.

    Raises:
        UsageError: The file cannot be written.
    """
    from service.reports.film import render_film

    write_file(path.parent, path.name, render_film(trial, own_floors))


def write_file(folder: Path, name: str, data: bytes) -> Path:
    """Write one file.

    Raises:
        UsageError: The folder cannot be written to.
    """
    path = folder / name
    try:
        with user_permissions():
            folder.mkdir(parents=True, exist_ok=True)
            path.write_bytes(data)
    except OSError as error:
        raise UsageError(f"{path} cannot be written: {error.strerror}") from error
    return path


def write_report(folder: Path, grade: Grade, submission: Submission, student_name: str, language: Language) -> Path:
    """Draw the plots of a grade and write the report, named after the student as ``student_name``. Return its path."""
    from service.reports.html import render_or_explain, render_report_page
    from service.reports.plots.grade_plots import draw_all_plots
    from service.reports.plots.plot import VECTOR_KINDS
    from service.reports.view import build_student_view
    from submissions.diagram_cells import read_diagrams

    view = build_student_view(grade, language=language)

    def render() -> str:
        cells = () if submission.notebook is None else read_diagrams(submission.notebook).cells
        plots = draw_all_plots(grade, cells=cells, omitted_kinds=VECTOR_KINDS)
        return render_report_page(view, plots, submission)

    return write_page(folder, f"{build_file_stem(student_name)}.html", render_or_explain(view, render))
