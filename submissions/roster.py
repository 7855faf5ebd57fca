"""Reads a CSV roster: which student submitted which file, for which assignment. Every bad row is named by its line.

Says where a file would lie, never outside the roster's folder; reading the submissions is `batch_folder.py``'s.
"""

from __future__ import annotations

import csv
import io
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from datetime import datetime, timedelta
from pathlib import Path, PurePosixPath

from sim.errors import UsageError
from submissions.names import LONGEST_NAME, shown_name
from submissions.raw_files import shown

COLUMNS = ("student", "file", "assignment", "submitted_at")
_MOST_BYTES = 10_000_000
_SEPARATORS = (",", ";", "\t")


@dataclass(frozen=True, slots=True)
class RosterRow:
    """One row. ``line`` counts from 1 and is where the row begins; a ``problem`` means the rest is not usable."""

    line: int
    student: str = ""
    file: str = ""
    assignment: str = ""
    problem: str = ""
    submitted_at: datetime | None = None


def read_roster(path: Path) -> list[RosterRow]:
    """The rows of a roster with the columns student, file and, if it has them, assignment and submitted_at.

    Other columns are passed over.

    Comma, semicolon or tab; quoted cells; UTF-8 with or without a byte order mark. Raises UsageError when the
    file as a whole is no roster.
    """
    lines = _text(path).splitlines(keepends=True)
    records = _records(lines, _separator(lines, path.name))
    header = next(records)
    places = _places(header, path.name)
    rows = [_row(record, places, len(header.cells)) for record in records if record.problem or any(record.cells)]
    if not rows:
        raise UsageError(f"{path.name}: has no rows, expected one for each student below the line of columns.")
    return rows


def file_inside(folder: Path, name: str) -> Path:
    """Where a file that a roster names lies. Raises UsageError for one that would lie outside ``folder``."""
    parts = PurePosixPath(name.replace("\\", "/")).parts
    outside = not parts or parts[0] == "/" or ".." in parts or any(part.endswith(":") for part in parts)
    path = folder.joinpath(*parts)
    try:
        # Links below the folder could lead out of it; whether the last part is one is for whoever opens it.
        outside = outside or not path.parent.resolve().is_relative_to(folder.resolve())
    except (OSError, ValueError):
        outside = True
    if outside:
        raise UsageError(f"{shown(name)} is outside the roster's folder, expected a path below it.")
    return path


@dataclass(frozen=True, slots=True)
class _Record:
    line: int
    cells: Sequence[str]
    problem: str = ""


def _text(path: Path) -> str:
    try:
        with path.open("rb") as stream:
            data = stream.read(_MOST_BYTES + 1)
    except OSError as error:
        raise UsageError(f"{path}: cannot be read: {error.strerror}.") from None
    if len(data) > _MOST_BYTES:
        raise UsageError(f"{path.name}: is larger than {_MOST_BYTES // 10**6} MB, expected a roster of students.")
    try:
        text = data.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        line = data.count(b"\n", 0, error.start) + 1
        raise UsageError(f"{path.name}: line {line} is not UTF-8; save it as CSV UTF-8.") from None
    # Only these end a line of a CSV; splitlines() knows more, and would miscount.
    text = text.replace("\r\n", "\n").replace("\r", "\n")
    return text.translate({ord(character): " " for character in "\v\f\x1c\x1d\x1e\x85\u2028\u2029"})


def _separator(lines: Sequence[str], name: str) -> str:
    """The separator by which the first line has most of our columns."""
    if not lines:
        raise UsageError(f"{name}: is empty, expected the columns {', '.join(COLUMNS[:3])}.")

    def found(separator: str) -> int:
        cells = next(_records(lines, separator)).cells
        return sum(cell.casefold() in COLUMNS for cell in cells)

    return max(_SEPARATORS, key=found)


def _records(lines: Sequence[str], separator: str) -> Iterator[_Record]:
    """The records of a CSV. After one with broken quotes it goes on at the next line, so that it costs one row."""
    start = 0
    while start < len(lines):
        reader = csv.reader(io.StringIO("".join(lines[start:]), newline=""), delimiter=separator, strict=True)
        begun = start
        try:
            for cells in reader:
                yield _Record(begun + 1, [cell.strip() for cell in cells])
                begun = start + reader.line_num
            return
        except csv.Error:
            yield _Record(begun + 1, (), 'has quotation marks that do not match (one inside a cell is written "").')
            start = begun + 1


def _places(header: _Record, name: str) -> Mapping[str, int]:
    """Where the columns stand."""
    if header.problem:
        raise UsageError(f"{name}: line 1 {header.problem}")
    cells = [cell.casefold() for cell in header.cells]
    for column in COLUMNS:
        if cells.count(column) > 1:
            raise UsageError(f"{name}: has two columns {column}, expected one.")
    missing = [column for column in COLUMNS[:2] if column not in cells]
    if missing:
        raise UsageError(
            f"{name}: has no column {' and no column '.join(missing)} in its first line, expected "
            f"{', '.join(COLUMNS[:3])} (assignment may be left out with -a)."
        )
    return {column: cells.index(column) for column in COLUMNS if column in cells}


def _row(record: _Record, places: Mapping[str, int], columns: int) -> RosterRow:
    if record.problem:
        return RosterRow(record.line, problem=record.problem)
    if any(record.cells[columns:]):
        return RosterRow(
            record.line, problem=f"has {len(record.cells)} cells for {columns} columns; quote a cell with a separator."
        )
    found = {column: record.cells[at] if at < len(record.cells) else "" for column, at in places.items()}
    student = shown_name(found["student"])
    problem = _problem(student, found["file"])
    try:
        submitted_at = moment(found["submitted_at"]) if found.get("submitted_at") else None
    except ValueError:
        submitted_at = None
        problem = (
            problem or f"has {shown(found['submitted_at'])} for submitted_at, expected a moment like 2026-11-30 17:00."
        )
    return RosterRow(record.line, student, found["file"], found.get("assignment", ""), problem, submitted_at)


def moment(text: str, *, end_of_day: bool = False) -> datetime:
    """A date, or a date and time, in the zone of this machine unless it names its own.

    A date alone is its first moment, or with ``end_of_day`` its last. Raises ValueError for anything else.
    """
    read = datetime.fromisoformat(text)
    if end_of_day and len(text.strip()) <= len("2026-11-30"):
        read += timedelta(days=1, microseconds=-1)
    return read.astimezone()


def _problem(student: str, file: str) -> str:
    if not student:
        return "names no student."
    if len(student) > LONGEST_NAME:
        return f"has a student's name of {len(student)} characters, expected at most {LONGEST_NAME}."
    return "" if file else "names no file."
