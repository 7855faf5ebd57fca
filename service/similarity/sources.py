"""The compared sources of a submission: its program, its responder, its notebook's cells, and other Python files.

It also returns code that is not the student's own: what was given for the assignment.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from functools import cache
from pathlib import Path

from responders import library
from sim.errors import UsageError
from submissions.assignment.definition import Assignment
from submissions.assignment.folder import list_catalogue_ids, locate_assignment_folder
from submissions.source_text import decode_source
from submissions.submission import Submission

#: The number of files that are read per submission. Further files are not compared.
MAX_FILES = 20


def extract_sources(submission: Submission) -> Mapping[str, str]:
    """Return the texts by name. A notebook's code cells form one text, in order."""
    texts: dict[str, str] = {}
    for part in (submission.program, submission.responder):
        if part is not None:
            texts[part.name] = part.text
    if submission.notebook is not None:
        texts[submission.notebook.name] = "\n\n".join(cell.source for cell in submission.notebook.cells)
    texts |= {name: code.text for name, code in submission.python_files.items() if name not in texts}
    return dict(list(texts.items())[:MAX_FILES])


def collect_given_code(assignment: Assignment, path: Path | None = None) -> tuple[str, ...]:
    """Return the code that students are given: the assignment's, its starter, the library's responders, and ``path``.

    Only the catalogue has starters, because stored assignments lack them.

    Raises:
        UsageError: ``path`` cannot be read.
    """
    texts = [*assignment.given_parts.values(), *(text for _, text in _decode_python_files(assignment.given))]
    texts += map(library.source, library.names())
    folders = [] if path is None else [path]
    if assignment.id in list_catalogue_ids():
        folders.append(locate_assignment_folder(assignment.id) / "starter")
    return (*texts, *(text for folder in folders for text in _read_python_files(folder)))


def _decode_python_files(files: Mapping[str, bytes]) -> Iterator[tuple[str, str]]:
    for name, data in files.items():
        if name.lower().endswith(".py"):
            try:
                yield name, decode_source(data, name).text
            except UsageError:
                continue  # not a text, so there is nothing to compare


@cache
def _read_python_files(path: Path) -> tuple[str, ...]:
    paths = sorted(path.rglob("*.py")) if path.is_dir() else [path]
    try:
        return tuple(decode_source(each.read_bytes(), each.name).text for each in paths)
    except OSError as error:
        raise UsageError(f"{error.filename}: cannot be read ({error.strerror}), expected Python files") from None
