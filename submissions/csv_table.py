"""Reads the rows of a CSV by the names of its columns, in whatever order and with whatever separator they come.

What the columns mean is for whoever asks; every row that cannot be read is named by its line.
"""

from __future__ import annotations

import csv
import io
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

from sim.errors import UsageError

_MOST_BYTES = 10_000_000
_SEPARATORS = (",", ";", "\t")


@dataclass(frozen=True, slots=True)
class CsvRow:
    """One row by its columns. ``line`` counts from 1 and is where it begins; with a ``problem`` there are no cells."""

    line: int
    cells: Mapping[str, str] = field(default_factory=dict)
    problem: str = ""


@dataclass(frozen=True, slots=True)
class CsvTable:
    """The rows, and which of the columns asked for there are."""

    columns: frozenset[str]
    rows: tuple[CsvRow, ...]


def read_csv(path: Path, columns: Mapping[str, Sequence[str]], usual: str) -> CsvTable:
    """The rows of a CSV. ``columns`` are asked for by their headings, of which each may have several.

    Other columns are passed over. Comma, semicolon or tab; quoted cells; UTF-8 with or without a byte order mark.
    Raises UsageError when the file as a whole cannot be read; ``usual`` says what its first line has.
    """
    lines = _text(path).splitlines(keepends=True)
    if not lines:
        raise UsageError(f"{path.name}: is empty, expected the columns {usual}.")
    by_heading = {heading: column for column, headings in columns.items() for heading in headings}
    records = _records(lines, _separator(lines, by_heading))
    header = next(records)
    places = _places(header, by_heading, path.name)
    rows = [_row(record, places, len(header.cells)) for record in records if record.problem or any(record.cells)]
    if not rows:
        raise UsageError(f"{path.name}: has no rows, expected one for each student below the line of columns.")
    return CsvTable(frozenset(places), tuple(rows))


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
        raise UsageError(f"{path.name}: is larger than {_MOST_BYTES // 10**6} MB, expected a list of students.")
    try:
        text = data.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        line = data.count(b"\n", 0, error.start) + 1
        raise UsageError(f"{path.name}: line {line} is not UTF-8; save it as CSV UTF-8.") from None
    # Only these end a line of a CSV; splitlines() knows more, and would miscount.
    text = text.replace("\r\n", "\n").replace("\r", "\n")
    return text.translate({ord(character): " " for character in "\v\f\x1c\x1d\x1e\x85\u2028\u2029"})


def _separator(lines: Sequence[str], by_heading: Mapping[str, str]) -> str:
    """The separator by which the first line has most of the columns."""

    def found(separator: str) -> int:
        cells = next(_records(lines, separator)).cells
        return sum(cell.casefold() in by_heading for cell in cells)

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


def _places(header: _Record, by_heading: Mapping[str, str], name: str) -> Mapping[str, int]:
    """Where the columns stand."""
    if header.problem:
        raise UsageError(f"{name}: line 1 {header.problem}")
    places: dict[str, int] = {}
    for place, cell in enumerate(header.cells):
        column = by_heading.get(cell.casefold())
        if column is None:
            continue
        if column in places:
            both = dict.fromkeys([header.cells[places[column]], cell])
            raise UsageError(f"{name}: has two columns {' and '.join(both)}, expected one.")
        places[column] = place
    return places


def _row(record: _Record, places: Mapping[str, int], columns: int) -> CsvRow:
    if record.problem:
        return CsvRow(record.line, problem=record.problem)
    if any(record.cells[columns:]):
        return CsvRow(
            record.line, problem=f"has {len(record.cells)} cells for {columns} columns; quote a cell with a separator."
        )
    cells = {column: record.cells[at] if at < len(record.cells) else "" for column, at in places.items()}
    return CsvRow(record.line, cells)
