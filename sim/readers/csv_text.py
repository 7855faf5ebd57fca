"""Comma-separated values, bounded by the cells that they would become.

``records`` goes on after a row with broken quotes, and reads no line more than ``MOST_LINES_OF_RECORD`` times for it.
"""

from __future__ import annotations

import csv
import io
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from sim.readers.unreadable import TooMany, Unreadable

MOST_CELLS = 2_000_000
#: A row of people or of submissions never spans more; one that does has an opening quotation mark too many.
MOST_LINES_OF_RECORD = 20


@dataclass(frozen=True, slots=True)
class CsvRecord:
    """One row: the line where it begins, from 1, and its cells, none where its quotation marks do not match."""

    line: int
    cells: Sequence[str]
    broken: bool = False


def read_rows(text: str, separator: str = ",") -> list[list[str]]:
    """Return all rows. Raises Unreadable for too many cells, and for a cell that is too long."""
    _check(text.count(separator) + text.count("\n"))
    try:
        return list(csv.reader(io.StringIO(text, newline=""), delimiter=separator))
    except csv.Error as error:
        raise Unreadable("its rows cannot be told apart (%(problem)s)", problem=str(error)) from None


def records(lines: Sequence[str], separator: str) -> Iterator[CsvRecord]:
    """Yield the rows of ``lines``, which end with line feeds. After a broken one it goes on at the next line.

    Raises Unreadable for too many cells.
    """
    _check(sum(line.count(separator) for line in lines) + len(lines))
    begun = 0

    def following(start: int) -> Iterator[str]:
        for number in range(start, len(lines)):
            if number - begun >= MOST_LINES_OF_RECORD:
                raise csv.Error("a row spans too many lines")
            yield lines[number]

    while begun < len(lines):
        start = begun
        reader = csv.reader(following(start), delimiter=separator, strict=True)
        try:
            for cells in reader:
                yield CsvRecord(begun + 1, cells)
                begun = start + reader.line_num
            return
        except csv.Error:
            yield CsvRecord(begun + 1, (), broken=True)
            begun += 1


def _check(cells: int) -> None:
    if cells > MOST_CELLS:
        raise TooMany("it has more than %(most)s cells", most=MOST_CELLS)
