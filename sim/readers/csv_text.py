"""CSV reader with a limit on the number of cells.

After a row with broken quotes, ``records`` continues at the next line. A row may span at most ``MAX_LINES_OF_RECORD``
lines.
"""

from __future__ import annotations

import csv
import io
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from sim.readers.reader_errors import TooManyValuesError, UnreadableDataError

MAX_CELLS = 2_000_000
#: Maximum lines of a row of people or submissions. A longer row has an unmatched quotation mark.
MAX_LINES_OF_RECORD = 20


@dataclass(frozen=True, slots=True)
class CsvRecord:
    """One row: its first line, counted from 1, and its cells; no cells if the quotation marks do not match."""

    line: int
    cells: Sequence[str]
    broken: bool = False


def read_rows(text: str, separator: str = ",") -> list[list[str]]:
    """Return all rows.

    Raises:
        UnreadableDataError: There are too many cells, or a cell is too long.
    """
    _check_cell_count(text.count(separator) + text.count("\n"))
    try:
        return list(csv.reader(io.StringIO(text, newline=""), delimiter=separator))
    except csv.Error as error:
        raise UnreadableDataError("its rows cannot be told apart (%(problem)s)", problem=str(error)) from None


def read_records(lines: Sequence[str], separator: str) -> Iterator[CsvRecord]:
    """Yield the rows of ``lines``, which end with line feeds. After a broken row, continue at the next line.

    Raises:
        UnreadableDataError: There are too many cells.
    """
    _check_cell_count(sum(line.count(separator) for line in lines) + len(lines))
    record_start = 0

    def iterate_lines(start: int) -> Iterator[str]:
        for number in range(start, len(lines)):
            if number - record_start >= MAX_LINES_OF_RECORD:
                raise csv.Error("a row spans too many lines")
            yield lines[number]

    while record_start < len(lines):
        start = record_start
        reader = csv.reader(iterate_lines(start), delimiter=separator, strict=True)
        try:
            for cells in reader:
                yield CsvRecord(record_start + 1, cells)
                record_start = start + reader.line_num
            return
        except csv.Error:
            yield CsvRecord(record_start + 1, (), broken=True)
            record_start += 1


def _check_cell_count(cells: int) -> None:
    if cells > MAX_CELLS:
        raise TooManyValuesError("it has more than %(most)s cells", most=MAX_CELLS)
