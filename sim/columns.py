"""Columns of a recording: name, unit, source in the world, and presentation.

The columns are defined in ``recording.py``. All code that writes, sends, stores or plots them uses that table.
"""

from __future__ import annotations

from dataclasses import KW_ONLY, dataclass, field, fields, replace
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray


@dataclass(frozen=True, slots=True)
class Panel:
    """Part of a plot for columns that share a unit. Without ``limits`` the axis fits the curves."""

    title: str
    _: KW_ONLY
    height: float = 0.62  # inches
    limits: tuple[float, float] | None = None
    marks: tuple[float, ...] = ()  # axis label
    per: float = 1.0  # divisor of the values
    rank: int = 0  # order of the panels; ties keep the order of their columns


@dataclass(frozen=True, slots=True)
class Column:
    """One quantity per tick. ``source`` is the path of its value in the world: a number, or ``width`` numbers.

    Programs read the column as ``sensor``, if set, and get the world's value at ``reading``. The hash chain contains
    every column with ``in_chain``. Columns added later are not in it, so that hashes of earlier recordings stay the
    same. Readings by programs are in the chain in any case.
    """

    unit: str
    source: str
    _: KW_ONLY
    name: str = ""  # name of the array in ``Ticks``
    width: int = 1
    whole: bool = False
    display_attribute: str = ""  # attribute of ``Ticks`` that traces and plots use instead
    sensor: str = ""
    reading: str = ""
    panel: Panel | None = None
    label: str = ""  # label of the curve
    in_chain: bool = True

    @property
    def dtype(self) -> type[np.generic]:
        """The data type of the array: int64 for whole numbers, otherwise float64."""
        import numpy as np

        return np.int64 if self.whole else np.float64

    def build_unknown_values(self, rows: int) -> NDArray[Any]:
        """Return the values for a recording that was made without this column."""
        import numpy as np

        return np.full((rows, self.width) if self.width > 1 else rows, 0 if self.whole else np.nan, self.dtype)


def column(unit: str, source: str, **more: Any) -> Any:
    """Define a field of ``Ticks`` that is a ``Column``."""
    return field(default=None, metadata={"column": Column(unit, source, **more)})


def collect_columns(table: type) -> tuple[Column, ...]:
    """Return the columns of a class, those of the chain first."""
    columns = (replace(each.metadata["column"], name=each.name) for each in fields(table) if "column" in each.metadata)
    named_columns = (
        replace(each, display_attribute=each.display_attribute or each.name, reading=each.reading or each.source)
        for each in columns
    )
    return tuple(sorted(named_columns, key=lambda each: not each.in_chain))
