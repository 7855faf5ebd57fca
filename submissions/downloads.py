"""Assignment of files to students in downloads from Moodle, Gradescope and nbgrader, and in plain folders.

Only Gradescope's list is opened here; ``bundle.py`` reads the submissions.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from sim.errors import UsageError
from sim.readers.reader_errors import UnreadableDataError
from submissions.raw_files import sanitise_name
from submissions.student_identity import HIDDEN_NAME, UNKNOWN_STUDENT, Student, make_unique_ids

IGNORED = {"__MACOSX", "__pycache__", "Thumbs.db", "desktop.ini"}
#: Moodle replaces underscores in a name by spaces, so the first number between underscores is Moodle's own.
_MOODLE = re.compile(r"(?P<name>.+?)_(?P<number>\d+)_assignsubmission_(?P<plugin>[a-z]+)(?:_(?P<file>.*))?", re.DOTALL)
#: Prefixes that must be a group. Other hyphens may belong to the student's name.
_GROUP = re.compile(r"^(?:[^-]*\bgroup\b[^-]*|[^-]*\d)-(?=\D)", re.IGNORECASE)
_SUFFIX = "assignsubmission_file_"
_GRADESCOPE_LIST = "submission_metadata.yml"
_NBGRADER, _NBGRADER_TIME = "submitted", "timestamp.txt"


@dataclass(frozen=True, slots=True)
class DownloadedFiles:
    """One student's files and the student as named there. With a ``problem``, they cannot be used.

    ``files`` is a file or folder, or a mapping from the student's file names to files.
    """

    source: str
    student: Student
    files: Path | Mapping[str, Path]
    number: str = ""  # Moodle's number of the student in this assignment
    assignment: str = ""  # if the platform exports several
    submitted_at: datetime | None = None
    problem: str = ""


def list_student_files(folder: Path) -> list[DownloadedFiles]:
    """Return the content of a folder, one row per student.

    Raises:
        UsageError: The platform's list of submissions cannot be read.
    """
    # Imported here, because callers of ``parse_moodle_number`` do not read submissions.
    from submissions.bundle import derive_student_name

    entries = _list_visible(folder)
    if (folder / _GRADESCOPE_LIST).is_file():
        return list(_read_gradescope(folder, entries))
    if _is_nbgrader(folder, entries):
        return list(_read_nbgrader(entries))
    moodle = {entry: found for entry in entries if (found := _MOODLE.fullmatch(entry.name))}
    other_files = [
        DownloadedFiles(sanitise_name(entry.name), Student(derive_student_name(entry)), entry)
        for entry in entries
        if entry not in moodle
    ]
    return [*_read_moodle(moodle), *other_files]


def is_student_folder(folder: Path) -> bool:
    """Return whether the folder name is one that Moodle gives to a single student's folder."""
    return _MOODLE.fullmatch(folder.name) is not None


def parse_moodle_number(source: str) -> str:
    """Return Moodle's number in the name of a submission; empty for other sources."""
    match = _MOODLE.fullmatch(source)
    return match["number"] if match else ""


def _list_visible(folder: Path) -> list[Path]:
    return sorted(entry for entry in folder.iterdir() if not entry.name.startswith(".") and entry.name not in IGNORED)


def _read_moodle(matches: Mapping[Path, re.Match[str]]) -> Iterator[DownloadedFiles]:
    """Yield a row for each number, with its folder or with the files that begin with it."""
    by_number: dict[str, list[Path]] = {}
    for path, match in matches.items():
        by_number.setdefault(match["number"], []).append(path)
    names = {number: matches[paths[0]]["name"] for number, paths in by_number.items()}
    people = {number: _GROUP.sub("", name, count=1).strip() for number, name in names.items()}
    ids = make_unique_ids((name, number) for number, name in people.items())
    for (number, paths), student_id in zip(by_number.items(), ids, strict=True):
        name = people[number]
        is_hidden = name == HIDDEN_NAME
        student = Student(f"{HIDDEN_NAME} {number}") if is_hidden else Student(student_id, name)
        files = {(matches[path]["file"] or path.name): path for path in paths if matches[path]["plugin"] == "file"}
        folders = [path for path in files.values() if path.is_dir()]
        problem = "" if files else "was typed into Moodle's text box, expected files."
        # Messages use the folder's own name. A shortened name would lose the number.
        own_name = folders[0].name if len(folders) == 1 else ""
        source = (
            own_name
            if own_name == sanitise_name(own_name) != ""
            else f"{sanitise_name(names[number])}_{number}_{_SUFFIX}"
        )
        yield DownloadedFiles(source, student, folders[0] if len(folders) == 1 else files, number, problem=problem)


def _read_gradescope(folder: Path, entries: Sequence[Path]) -> Iterator[DownloadedFiles]:
    """Yield a row for each student of a joint submission."""
    submissions = read_gradescope_list(folder / _GRADESCOPE_LIST)
    folder_names = [entry.name for entry in entries if _is_folder(entry)]
    for name in dict.fromkeys([*submissions, *folder_names]):
        entry = submissions.get(name)
        submitters = list(_read_submitters(entry))
        problem = "" if submitters else f"is nobody's in {_GRADESCOPE_LIST}, expected its submitters there."
        if name not in folder_names:
            problem = f"is in {_GRADESCOPE_LIST} and not beside it, expected a folder of that name."
        created_at = entry.get(":created_at") if isinstance(entry, dict) else None
        for student in submitters or [UNKNOWN_STUDENT]:
            yield DownloadedFiles(
                sanitise_name(name), student, folder / name, submitted_at=_parse_time(created_at), problem=problem
            )


def _read_submitters(entry: object) -> Iterator[Student]:
    submitters = entry.get(":submitters") if isinstance(entry, dict) else None
    for submitter in submitters if isinstance(submitters, list) else []:
        sid, name, email = (_read_text(submitter, key) for key in (":sid", ":name", ":email"))
        if sid or name or email:
            yield Student(sid or email or name, name, email)


def _read_text(table: object, key: str) -> str:
    value = table.get(key) if isinstance(table, dict) else None
    return value.strip() if isinstance(value, str) and value.strip() not in ("~", "null") else ""


def _parse_time(value: object) -> datetime | None:
    """Parse a Ruby timestamp, which is inside a table if it has a zone; None if it cannot be read."""
    text = _read_text(value, "utc") if isinstance(value, dict) else value
    if not isinstance(text, str):
        return None
    match = re.match(r"(\d{4}-\d\d-\d\d)[ T](\d\d:\d\d:\d\d)(\.\d+)?\s*(Z|UTC|[+-]\d\d:?\d\d)?", text)
    if match is None:
        return None
    zone = match[4] if match[4] and match[4][0] in "+-" else "+00:00"
    try:
        return datetime.fromisoformat(f"{match[1]}T{match[2]}{zone}").astimezone(UTC)
    except (ValueError, OverflowError):
        return None


def _is_nbgrader(folder: Path, entries: Sequence[Path]) -> bool:
    """Return whether the folder has student folders that contain only assignment folders."""
    entries_inside = [entry for student in entries if _is_folder(student) for entry in _list_visible(student)]
    folders_alone = all(_is_folder(entry) for entry in (*entries, *entries_inside))
    has_timestamp = any((entry / _NBGRADER_TIME).is_file() for entry in entries_inside)
    return bool(entries_inside) and folders_alone and (has_timestamp or folder.name == _NBGRADER)


def _read_nbgrader(entries: Sequence[Path]) -> Iterator[DownloadedFiles]:
    for student in entries:
        for assignment_folder in _list_visible(student):
            files = {
                path.name: path
                for path in _list_visible(assignment_folder)
                if path.name != _NBGRADER_TIME and not path.is_dir()
            }
            stamp = assignment_folder / _NBGRADER_TIME
            timestamp = _read_beginning(stamp) if stamp.is_file() else ""
            source = sanitise_name(f"{student.name}/{assignment_folder.name}")
            yield DownloadedFiles(
                source,
                Student(student.name),
                files,
                assignment=assignment_folder.name,
                submitted_at=_parse_time(timestamp),
            )


def _is_folder(path: Path) -> bool:
    return path.is_dir() and not path.is_symlink()


def _read_beginning(path: Path) -> str:
    with path.open("rb") as stream:
        return stream.read(100).decode("utf-8", "replace").strip()


def read_gradescope_list(path: Path) -> dict[str, Any]:
    """Return the submissions by folder from the list in a Gradescope export.

    All values are texts; YAML tags and merge keys have no effect.

    Raises:
        UsageError: The file is not such a list.
    """
    # Only Gradescope's lists are YAML.
    from sim.readers.yaml_text import MAX_BYTES, read_yaml

    try:
        with path.open("rb") as stream:
            submissions = read_yaml(stream.read(MAX_BYTES + 1))
    except OSError as error:
        raise UsageError(f"{path.name}: cannot be read: {error.strerror}.") from None
    except UnreadableDataError as error:
        raise UsageError(f"{path.name}: cannot be read: {error}, expected the file exported from Gradescope.") from None
    if not isinstance(submissions, dict):
        raise UsageError(f"{path.name}: is not a list of submissions, expected the file exported from Gradescope.")
    return {name: own for name, own in submissions.items() if isinstance(name, str)}
