"""CSV reader by column names, for any order of columns and any common separator.

Callers interpret the columns. Rows that cannot be read are reported with their lines.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

from sim.errors import UsageError
from sim.readers.csv_text import CsvRecord, read_records
from sim.readers.reader_errors import UnreadableDataError

_MAX_BYTES, _MAX_LINES = 10_000_000, 200_000
_SEPARATORS = (",", ";", "\t")
#: Maximum number of lines of the header row.
_MAX_HEADING_LENGTH = 20
_QUOTES_PROBLEM = 'has quotation marks that do not match (one inside a cell is written "").'


@dataclass(frozen=True, slots=True)
class CsvRow:
    """One row by its columns. ``line`` is its first line, from 1; a row with a ``problem`` has no cells."""

    line: int
    cells: Mapping[str, str] = field(default_factory=dict)
    problem: str = ""


@dataclass(frozen=True, slots=True)
class CsvTable:
    """The rows, and the requested columns that exist."""

    columns: frozenset[str]
    rows: tuple[CsvRow, ...]


def read_csv(path: Path, columns: Mapping[str, Sequence[str]], usual_columns: str) -> CsvTable:
    """Read a CSV file. ``columns`` gives the accepted headings of each requested column.

    Other columns are ignored. The separator is a comma, semicolon or tab; cells can be quoted; the text is UTF-8 with
    or without a byte order mark. ``usual_columns`` describes the header in error messages.

    Raises:
        UsageError: The file as a whole cannot be read.
    """
    lines = _read_text(path).splitlines(keepends=True)
    if not lines:
        raise UsageError(f"{path.name}: is empty, expected the columns {usual_columns}.")
    by_heading = {heading: column for column, headings in columns.items() for heading in headings}
    try:
        header, *records = read_records(lines, _detect_separator(lines, by_heading))
    except UnreadableDataError as error:
        raise UsageError(f"{path.name}: cannot be read: {error}, expected a list of students.") from None
    positions = _find_columns(header, by_heading, path.name)
    rows = [
        _build_row(record, positions, len(header.cells))
        for record in records
        if record.broken or any(map(str.strip, record.cells))
    ]
    if not rows:
        raise UsageError(f"{path.name}: has no rows, expected one for each student below the line of columns.")
    return CsvTable(frozenset(positions), tuple(rows))


def _read_text(path: Path) -> str:
    try:
        with path.open("rb") as stream:
            data = stream.read(_MAX_BYTES + 1)
    except OSError as error:
        raise UsageError(f"{path}: cannot be read: {error.strerror}.") from None
    if len(data) > _MAX_BYTES:
        raise UsageError(f"{path.name}: is larger than {_MAX_BYTES // 10**6} MB, expected a list of students.")
    try:
        text = data.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        line = data.count(b"\n", 0, error.start) + 1
        raise UsageError(f"{path.name}: line {line} is not UTF-8; save it as CSV UTF-8.") from None
    # Only these characters end a CSV line. splitlines() accepts more, which would give wrong line numbers.
    text = text.replace("\r\n", "\n").replace("\r", "\n")
    if text.count("\n") > _MAX_LINES:
        raise UsageError(f"{path.name}: has more than {_MAX_LINES} lines, expected a list of students.")
    return text.translate({ord(character): " " for character in "\v\f\x1c\x1d\x1e\x85\u2028\u2029"})


def _detect_separator(lines: Sequence[str], by_heading: Mapping[str, str]) -> str:
    """Return the separator with which the first line contains most of the requested columns."""

    def found(separator: str) -> int:
        cells = next(read_records(lines[:_MAX_HEADING_LENGTH], separator)).cells
        return sum(cell.strip().casefold() in by_heading for cell in cells)

    return max(_SEPARATORS, key=found)


def _find_columns(header: CsvRecord, by_heading: Mapping[str, str], name: str) -> Mapping[str, int]:
    """Return the positions of the columns."""
    if header.broken:
        raise UsageError(f"{name}: line 1 {_QUOTES_PROBLEM}")
    positions: dict[str, int] = {}
    headings = [cell.strip() for cell in header.cells]
    for position, cell in enumerate(headings):
        column = by_heading.get(cell.casefold())
        if column is None:
            continue
        if column in positions:
            heading_pair = dict.fromkeys([headings[positions[column]], cell])
            raise UsageError(f"{name}: has two columns {' and '.join(heading_pair)}, expected one.")
        positions[column] = position
    return positions


def _build_row(record: CsvRecord, positions: Mapping[str, int], columns: int) -> CsvRow:
    if record.broken:
        return CsvRow(record.line, problem=_QUOTES_PROBLEM)
    cells = [cell.strip() for cell in record.cells]
    if any(cells[columns:]):
        return CsvRow(
            record.line, problem=f"has {len(cells)} cells for {columns} columns; quote a cell with a separator."
        )
    return CsvRow(record.line, {column: cells[at] if at < len(cells) else "" for column, at in positions.items()})
