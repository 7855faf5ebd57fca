"""Reader of CSV rosters: students, files and assignments. Bad rows are reported with their lines.

Files are located inside the roster's folder only; ``batch_folder.py`` reads the submissions.
"""

from __future__ import annotations

from dataclasses import dataclass
from datetime import UTC, datetime, timedelta
from pathlib import Path, PurePosixPath

from sim.errors import UsageError
from submissions.csv_table import CsvRow, read_csv
from submissions.raw_files import sanitise_name
from submissions.student_identity import PERSON_COLUMNS, UNKNOWN_STUDENT, Student
from submissions.student_names import MAX_NAME_LENGTH, normalise_name

_OWN_COLUMNS = ("file", "assignment", "submitted_at")
_USUAL_COLUMNS = "student (or id), file, assignment"


@dataclass(frozen=True, slots=True)
class RosterRow:
    """One row. ``line`` is its first line, from 1. With a ``problem``, the other fields cannot be used."""

    line: int
    student: Student = UNKNOWN_STUDENT
    file: str = ""
    assignment: str = ""
    problem: str = ""
    submitted_at: datetime | None = None


def read_roster(path: Path) -> list[RosterRow]:
    """Read the rows of a roster: student (or id) and file; optionally name, email, assignment, submitted_at.

    Raises:
        UsageError: The file as a whole is not a roster.
    """
    table = read_csv(path, {**PERSON_COLUMNS, **{column: (column,) for column in _OWN_COLUMNS}}, _USUAL_COLUMNS)
    missing_headings = [said for column, said in (("id", "student"), ("file", "file")) if column not in table.columns]
    if missing_headings:
        raise UsageError(
            f"{path.name}: has no column {' and no column '.join(missing_headings)} in its first line, expected "
            f"{_USUAL_COLUMNS} (assignment may be left out with -a)."
        )
    return [_build_row(row) for row in table.rows]


def resolve_file(folder: Path, name: str) -> Path:
    """Return the path of a file that a roster names.

    Raises:
        UsageError: The path is outside ``folder``.
    """
    parts = PurePosixPath(name.replace("\\", "/")).parts
    is_outside = not parts or parts[0] == "/" or ".." in parts or any(part.endswith(":") for part in parts)
    path = folder.joinpath(*parts)
    try:
        # Links in the path could lead outside the folder. The caller that opens the file checks its last part.
        is_outside = is_outside or not path.parent.resolve().is_relative_to(folder.resolve())
    except (OSError, ValueError):
        is_outside = True
    if is_outside:
        raise UsageError(f"{sanitise_name(name)} is outside the roster's folder, expected a path below it.")
    return path


def _build_row(row: CsvRow) -> RosterRow:
    if row.problem:
        return RosterRow(row.line, problem=row.problem)
    cells = row.cells
    student = Student(normalise_name(cells["id"]), normalise_name(cells.get("name", "")), cells.get("email", ""))
    problem = _find_problem(student.id, cells["file"])
    try:
        submitted_at = parse_time(cells["submitted_at"]) if cells.get("submitted_at") else None
    except ValueError:
        submitted_at = None
        problem = (
            problem
            or f"has {sanitise_name(cells['submitted_at'])} for submitted_at, expected a moment like 2026-11-30 17:00."
        )
    return RosterRow(row.line, student, cells["file"], cells.get("assignment", ""), problem, submitted_at)


def parse_time(text: str, *, end_of_day: bool = False) -> datetime:
    """Parse a date, or a date and time, in this machine's time zone unless it names another.

    A date alone means its first moment, or its last with ``end_of_day``.

    Raises:
        ValueError: The text is not a date or time.
    """
    moment = datetime.fromisoformat(text)
    try:
        if end_of_day and len(text.strip()) <= len("2026-11-30"):
            moment += timedelta(days=1, microseconds=-1)
        # Stored times are in UTC, so that must be possible too.
        return moment.astimezone(UTC).astimezone()
    except OverflowError:
        raise ValueError(f"{text!r} is too early or too late") from None


def _find_problem(student: str, file: str) -> str:
    if not student:
        return "has no student."
    if len(student) > MAX_NAME_LENGTH:
        return f"has a student's name of {len(student)} characters, expected at most {MAX_NAME_LENGTH}."
    return "" if file else "has no file."
