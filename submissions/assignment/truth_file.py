"""Reading an instructor's own truths: a CSV file of x, y, label beside the assignment.

What is at which place, and nothing else; judging by it is the service's.
"""

from __future__ import annotations

import csv
import io
import math
from collections.abc import Mapping, Sequence
from typing import Annotated

from sim.errors import UsageError
from submissions.strict_table import Shape

#: x, y (mm) and what is there.
LabelledPlace = Annotated[tuple[float, float, str], Shape("[x, y, label]")]
_MOST_PLACES = 10_000


def read_places(name: str, files: Mapping[str, bytes]) -> tuple[LabelledPlace, ...]:
    """The rows of the file: x and y (mm) and a label; a first row ``x,y,label`` and empty rows are passed over.

    Raises UsageError, with the line, for a file or a row that cannot be used.
    """
    if name not in files:
        raise UsageError(f'places is "{name[:60]}", expected a CSV file of x, y, label beside this file')
    try:
        text = files[name].decode("utf-8-sig")
    except UnicodeDecodeError:
        raise UsageError(f"{name} is not UTF-8, expected a CSV file saved as UTF-8") from None
    rows = list(csv.reader(io.StringIO(text)))
    if len(rows) > _MOST_PLACES:
        raise UsageError(f"{name} has {len(rows)} rows, expected at most {_MOST_PLACES}")
    first = 1 if rows and [cell.strip().casefold() for cell in rows[0]] == ["x", "y", "label"] else 0
    places = tuple(
        _place(row, f"{name}:{number}") for number, row in enumerate(rows, start=1) if number > first and any(row)
    )
    if not places:
        raise UsageError(f"{name} has no places in it, expected rows of x, y, label")
    return places


def _place(row: Sequence[str], where: str) -> LabelledPlace:
    try:
        x, y, label = (cell.strip() for cell in row)
        place = float(x), float(y), label
    except ValueError:
        raise UsageError(f"{where}: {','.join(row)[:60]!r} is no place, expected x, y (mm) and a label") from None
    if not (math.isfinite(place[0]) and math.isfinite(place[1]) and label):
        raise UsageError(f"{where}: {','.join(row)[:60]!r} is no place, expected x, y (mm) and a label")
    return place
