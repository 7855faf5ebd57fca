"""Creation of assignment folders: a new assignment, a copy, and the version for students.

``reader.py`` defines the content of a valid folder.
"""

from __future__ import annotations

import os
import re
import tempfile
import zipfile
from collections.abc import Mapping
from importlib import resources
from pathlib import Path

from sim.errors import UsageError
from submissions.assignment.folder import FILE_NAME, locate_assignment_folder
from submissions.assignment.reader import NON_GRADING_FILES, read_assignment, walk_files
from submissions.assignment.task_sheet import TaskSheet, build_task_sheet

_ID_LINE = re.compile(r'^id = "[^"]*"', re.MULTILINE)
_SLUG = re.compile(r"[a-z0-9][a-z0-9_-]{0,79}")


def create_assignment(folder: Path, model: str | None = None) -> None:
    """Create ``folder`` from the commented template, or from the assignment ``model``, with a new id.

    Raises:
        UsageError: The folder exists or cannot be created, or its name is not a valid id.
    """
    name = Path(os.path.abspath(folder)).name  # noqa: PTH100 - a link keeps the name it was given
    if not _SLUG.fullmatch(name):
        raise UsageError(
            f'"{name}" cannot be the id of an assignment, expected small letters, digits, - and _, such as my-task'
        )
    source = locate_assignment_folder(model) if model is not None else _locate_template()
    read_assignment(source)
    files = _read_files(source)
    text = files[FILE_NAME].decode("utf-8")
    _write_files(folder, {**files, FILE_NAME: _ID_LINE.sub(f'id = "{name}"', text, count=1).encode()})


def export_all(assignment: str, target: Path) -> int:
    """Write the whole folder of the assignment, with examples, and return the number of files.

    Raises:
        UsageError: The folder cannot be written.
    """
    source = locate_assignment_folder(assignment)
    read_assignment(source)
    return _write_files(target, _read_files(source))


def export_for_grading(assignment: str, target: Path) -> int:
    """Write the files that decide the marks, without examples, and return the number of files.

    Raises:
        UsageError: The folder cannot be written.
    """
    source = locate_assignment_folder(assignment)
    read_assignment(source)
    return _write_files(
        target,
        {name: data for name, data in _read_files(source).items() if name.split("/")[0] not in NON_GRADING_FILES},
    )


def export_for_students(assignment: str, target: Path) -> int:
    """Write the files for students, and return their number.

    These are the task with the visible criteria, the starter files and the given files.

    Raises:
        UsageError: The folder cannot be written.
    """
    source = locate_assignment_folder(assignment)
    definition = read_assignment(source)
    prefix = "starter/"
    starter = {name.removeprefix(prefix): data for name, data in _read_files(source).items() if name.startswith(prefix)}
    sheet = build_task_sheet(definition)
    return _write_files(target, {**sheet.given, **starter, "README.md": _render_task(sheet).encode()})


def _render_task(sheet: TaskSheet) -> str:
    """Return the task in Markdown."""
    lines = [f"# {sheet.title}", ""]
    if sheet.description:
        lines += [sheet.description, ""]
    lines += ["| Marks | For |", "|---:|---|"]
    lines += [f"| {marks:g} | {title.replace('|', chr(92) + '|')} |" for title, marks in sheet.criteria]
    if sheet.more_marks:
        lines += ["", f"Marks for hidden criteria: {sheet.more_marks:g}"]
    return "\n".join(lines) + "\n"


def _locate_template() -> Path:
    return Path(str(resources.files("submissions"))) / "template"


def _read_files(folder: Path) -> Mapping[str, bytes]:
    """Return all files in the folder."""
    return {"/".join(parts): path.read_bytes() for parts, path in walk_files(folder)}


def _write_files(target: Path, files: Mapping[str, bytes]) -> int:
    """Write all files or none: write them beside ``target``, then rename."""
    if target.exists() or target.is_symlink():
        raise UsageError(f"{target} exists already, expected a new folder or .zip")
    try:
        target.parent.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryDirectory(dir=target.parent, prefix=".robomark-") as scratch:
            staging_path = Path(scratch) / "made"
            if target.suffix.lower() == ".zip":
                _write_zip(staging_path, files)
            else:
                _write_folder(staging_path, files)
            staging_path.rename(target)
    except OSError as error:
        raise UsageError(f"{target} cannot be written: {error.strerror}") from error
    return len(files)


def _write_folder(folder: Path, files: Mapping[str, bytes]) -> None:
    for name, data in files.items():
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).write_bytes(data)


def _write_zip(path: Path, files: Mapping[str, bytes]) -> None:
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, data in files.items():
            archive.writestr(name, data)
