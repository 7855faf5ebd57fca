"""Reads a folder, zip or roster of hand-ins before anything is queued: what can be graded, and what not.

Every bad row is named and stops no other. Nothing is stored here.
"""

from __future__ import annotations

import os
import shutil
import tempfile
import zipfile
import zlib
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from functools import cache, partial
from pathlib import Path, PurePosixPath

from service.roster import RosterRow, file_inside, read_roster
from service.store.intake import HandIn
from sim.errors import UsageError
from submissions.assignment import Assignment
from submissions.assignment_file import catalogue, find_assignment, find_in_catalogue, read_assignment
from submissions.bundle import clean_name, fit_parts, read_submission
from submissions.raw_files import shown
from submissions.submission import Submission

_PARTS = {"robot.py", "program.py", "responder.py"}
_IGNORED = {"__MACOSX", "__pycache__", "Thumbs.db", "desktop.ini"}
_MOST_ENTRIES = 50_000
_MOST_BYTES = 4_000_000_000
_CHUNK = 1 << 20


@dataclass(frozen=True, slots=True)
class Preflight:
    """What a batch would take in, and the rows it would not: name, sentence."""

    hand_ins: tuple[HandIn, ...]
    problems: tuple[tuple[str, str], ...]


@dataclass(frozen=True, slots=True)
class _Row:
    """A row by the name it is spoken of, and how its hand-in is read; that raises UsageError."""

    name: str
    read: Callable[[], HandIn]


def preflight(path: Path, assignment: str | None) -> Preflight:
    """Read every hand-in of a folder, zip or CSV roster.

    In a folder or zip a subfolder, a .py or a .zip is one student's, and without ``assignment`` each hand-in names
    its own. A roster names student and file; ``assignment`` is for the rows that name none. Raises UsageError when
    ``path`` or ``assignment`` itself cannot be used.
    """
    asked = None if assignment is None else find_assignment(assignment)
    if path.is_file() and path.suffix.lower() == ".csv":
        find = cache(partial(_roster_assignment, path.parent))
        return _read(
            _Row(
                shown(f"line {row.line}: {row.student}" if row.student else f"line {row.line}"),
                partial(_roster_hand_in, path.parent, row, asked, find),
            )
            for row in read_roster(path)
        )
    with _opened(path) as folder:
        find_own = cache(find_in_catalogue)
        return _read([_Row(shown(entry.name), partial(_hand_in, entry, asked, find_own)) for entry in _entries(folder)])


def _read(rows: Iterable[_Row]) -> Preflight:
    hand_ins: list[HandIn] = []
    problems: list[tuple[str, str]] = []
    first: dict[tuple[str, str], str] = {}
    for row in rows:
        try:
            hand_in = row.read()
        except UsageError as error:
            problems.append((row.name, " ".join(str(error).split())))
            continue
        key = (hand_in.submission.student, hand_in.assignment.id)
        if key in first:
            sentence = f"{first[key]} is already this student's hand-in for {key[1]}; this one is left out."
            problems.append((row.name, sentence))
            continue
        first[key] = row.name
        hand_ins.append(hand_in)
    return Preflight(tuple(hand_ins), tuple(problems))


def _hand_in(entry: Path, asked: Assignment | None, find: Callable[[str], Assignment]) -> HandIn:
    if asked is not None:
        return HandIn(_named(read_submission(entry, asked=asked.parts), entry), asked, shown(entry.name))
    submission = read_submission(entry)
    if submission.assignment is None:
        raise UsageError("does not say which assignment it is for; name it with -a, or in its submission.toml.")
    own = find(submission.assignment)
    return HandIn(_named(fit_parts(submission, own.parts), entry), own, shown(entry.name))


def _named(submission: Submission, entry: Path) -> Submission:
    """By the name of its file or folder: in a batch nobody hands in for somebody else."""
    student = clean_name(entry.name if entry.is_dir() else entry.stem)
    if submission.student == student:
        return submission
    note = f"submission.toml names the student {submission.student}; in a batch the name of the file or folder counts."
    return replace(submission, student=student, notes=(*submission.notes, note))


def _roster_hand_in(
    folder: Path, row: RosterRow, asked: Assignment | None, find: Callable[[str], Assignment]
) -> HandIn:
    if row.problem:
        raise UsageError(row.problem)
    if not row.assignment and asked is None:
        raise UsageError("names no assignment; name it with -a, or in a column assignment.")
    path = file_inside(folder, row.file)
    assignment = find(row.assignment) if row.assignment or asked is None else asked
    submission = read_submission(path, asked=assignment.parts)
    return HandIn(replace(submission, student=row.student), assignment, shown(row.file), row.handed_in)


def _roster_assignment(folder: Path, name: str) -> Assignment:
    """An id of the catalogue, or a folder that the roster names as it names files."""
    if name in catalogue():
        return find_assignment(name)
    path = file_inside(folder, name)
    return read_assignment(path) if path.is_dir() else find_assignment(name)


def _entries(folder: Path) -> list[Path]:
    entries = sorted(
        entry for entry in folder.iterdir() if not entry.name.startswith(".") and entry.name not in _IGNORED
    )
    parts = [entry.name for entry in entries if entry.name.lower() in _PARTS]
    if parts:
        raise UsageError(
            f"{folder.name}: has {parts[0]} in it, so it looks like one hand-in; a batch is a folder with a "
            "subfolder, .py or .zip for each student (one hand-in is graded with robomark grade)."
        )
    if not entries:
        raise UsageError(f"{folder.name}: is empty, expected a subfolder, .py or .zip for each student.")
    return entries


@contextmanager
def _opened(path: Path) -> Iterator[Path]:
    if path.is_dir():
        yield path
    elif path.is_file() and path.suffix.lower() == ".zip":
        with tempfile.TemporaryDirectory(prefix="robomark-batch-") as name:
            # The name of the zip stands for the folder, so that sentences and assignments speak of it.
            folder = Path(name) / (path.stem or "batch")
            folder.mkdir()
            _unzip(path, folder)
            yield _stepped_into(folder)
    elif not path.exists():
        raise UsageError(f"{path}: does not exist, expected a folder or a .zip of hand-ins, or a .csv roster.")
    else:
        raise UsageError(
            f"{path}: is neither a folder nor a .zip nor a .csv, expected one with a hand-in for each student."
        )


def _stepped_into(folder: Path) -> Path:
    """The only folder inside, where archives have one around the hand-ins; but not a lone student's."""
    inside = [entry for entry in folder.iterdir() if entry.name not in _IGNORED]
    if len(inside) != 1 or not inside[0].is_dir():
        return folder
    files = {entry.name.lower() for entry in inside[0].iterdir()}
    return folder if files & _PARTS else inside[0]


def _unzip(path: Path, folder: Path) -> None:
    left = _MOST_BYTES
    try:
        with zipfile.ZipFile(path) as archive:
            infos = [info for info in archive.infolist() if not info.is_dir()]
            if len(infos) > _MOST_ENTRIES:
                raise UsageError(f"{path.name}: holds {len(infos)} files, expected at most {_MOST_ENTRIES}.")
            for info in infos:
                target = _target(folder, info.filename, path.name)
                target.parent.mkdir(parents=True, exist_ok=True)
                with archive.open(info) as source, target.open("xb") as sink:
                    while chunk := source.read(_CHUNK):
                        left -= len(chunk)
                        if left < 0:
                            raise UsageError(f"{path.name}: unpacks to more than {_MOST_BYTES // 10**9} GB.")
                        sink.write(chunk)
    except FileExistsError:
        raise UsageError(f"{path.name}: holds two files of the same name.") from None
    except (zipfile.BadZipFile, zlib.error, EOFError, RuntimeError, NotImplementedError, ValueError) as error:
        raise UsageError(f"{path.name}: cannot be unpacked: {error}.") from None
    except OSError as error:
        free = shutil.disk_usage(folder).free
        raise UsageError(f"{path.name}: cannot be unpacked: {error.strerror} ({free >> 20} MB free).") from None


def _target(folder: Path, name: str, archive: str) -> Path:
    parts = PurePosixPath(name.replace("\\", "/")).parts
    if not parts or parts[0] == "/" or ".." in parts or any(os.fsencode(part)[-1:] == b":" for part in parts):
        raise UsageError(f"{archive}: holds a file that would lie outside it: {shown(name)}.")
    return folder.joinpath(*parts)
