"""Reader of an instructor's CSV files of known answers: labelled places, or calls of a function.

``service`` compares submissions with these answers.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Annotated

from sim.errors import UsageError
from sim.readers.csv_text import read_rows
from sim.readers.reader_errors import UnreadableDataError
from submissions.strict_table import Entries

#: x and y in mm, and the label.
LabelledPlace = Annotated[tuple[float, float, str], Entries("[x, y, label]")]
_MAX_PLACES = 10_000
_MAX_CALLS = 1000


def read_places(name: str, files: Mapping[str, bytes]) -> tuple[LabelledPlace, ...]:
    """Read rows of x and y (mm) and a label. A header row ``x,y,label`` and empty rows are skipped.

    Raises:
        UsageError: The file or a row cannot be used. The message has the line.
    """
    rows = _read_csv_rows(name, files, "places", "x, y, label")
    if len(rows) > _MAX_PLACES:
        raise UsageError(f"{name} has {len(rows)} rows, expected at most {_MAX_PLACES}")
    header_rows = 1 if rows and [cell.strip().casefold() for cell in rows[0]] == ["x", "y", "label"] else 0
    places = tuple(
        _parse_place(row, f"{name}:{number}")
        for number, row in enumerate(rows, start=1)
        if number > header_rows and any(row)
    )
    if not places:
        raise UsageError(f"{name} has no places, expected rows of x, y, label")
    return places


def read_table(name: str, files: Mapping[str, bytes]) -> tuple[tuple[str, ...], ...]:
    """Read the rows below the header. Each must have as many cells as the header.

    Raises:
        UsageError: The file or a row cannot be used. The message has the line.
    """
    headings, *rows = _read_csv_rows(name, files, "table", "an answer and arguments") or [[]]
    numbered_rows = [(number, row) for number, row in enumerate(rows, start=2) if any(row)]
    if not numbered_rows or len(numbered_rows) > _MAX_CALLS:
        raise UsageError(f"{name} has {len(numbered_rows)} rows, expected headings and 1 to {_MAX_CALLS} rows")
    for number, row in numbered_rows:
        if len(row) != len(headings):
            raise UsageError(f"{name}:{number} has {len(row)} cells, expected {len(headings)} as in the first row")
    return tuple(tuple(row) for _, row in numbered_rows)


def _read_csv_rows(name: str, files: Mapping[str, bytes], key: str, columns: str) -> list[list[str]]:
    if name not in files:
        raise UsageError(f'{key} is "{name[:60]}", expected a CSV file of {columns} beside this file')
    try:
        text = files[name].decode("utf-8-sig")
    except UnicodeDecodeError:
        raise UsageError(f"{name} is not UTF-8, expected a CSV file saved as UTF-8") from None
    try:
        return read_rows(text)
    except UnreadableDataError as error:
        raise UsageError(f"{name} cannot be read: {error}, expected rows of {columns}") from None


def _parse_place(row: Sequence[str], source_name: str) -> LabelledPlace:
    try:
        x, y, label = (cell.strip() for cell in row)
        place = float(x), float(y), label
    except ValueError:
        raise UsageError(
            f"{source_name}: {','.join(row)[:60]!r} is not a place, expected x, y (mm) and a label"
        ) from None
    if not (math.isfinite(place[0]) and math.isfinite(place[1]) and label):
        raise UsageError(f"{source_name}: {','.join(row)[:60]!r} is not a place, expected x, y (mm) and a label")
    return place
