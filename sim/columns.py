"""What a column of a recording is: its name, its unit, where the world has its value, and how readers are shown it.

The columns themselves stand in ``recording.py``; all that writes, sends, keeps or draws them goes through that table.
"""

from __future__ import annotations

from dataclasses import KW_ONLY, dataclass, field, fields, replace
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray


@dataclass(frozen=True, slots=True)
class Panel:
    """A part of a plot for columns that share a unit. Without ``limits`` it fits its curves."""

    title: str
    _: KW_ONLY
    height: float = 0.62  # inches
    limits: tuple[float, float] | None = None
    marks: tuple[float, ...] = ()  # on its axis
    per: float = 1.0  # what values are divided by
    rank: int = 0  # panels stand in this order, and else in that of their columns


@dataclass(frozen=True, slots=True)
class Column:
    """One quantity of every tick. ``source`` is the path of its value from the world: a number, or ``width`` of them.

    A program reads it as ``sensor``, if it can, and gets what the world has at ``reading``. The chain has every column
    but those that came later and are not ``in_chain``: with them the hashes of earlier recordings would change, and
    what a program has read is in it anyway.
    """

    unit: str
    source: str
    _: KW_ONLY
    name: str = ""  # of the array in ``Ticks``
    width: int = 1
    whole: bool = False
    told_as: str = ""  # what traces and plots are told in its place, an attribute of ``Ticks``
    sensor: str = ""
    reading: str = ""
    panel: Panel | None = None
    label: str = ""  # of its curve
    in_chain: bool = True

    @property
    def dtype(self) -> type[np.generic]:
        """The type of its array: int64 for whole numbers, else float64."""
        import numpy as np

        return np.int64 if self.whole else np.float64

    def unknown(self, rows: int) -> NDArray[Any]:
        """What stands in a recording that was made without this column."""
        import numpy as np

        return np.full((rows, self.width) if self.width > 1 else rows, 0 if self.whole else np.nan, self.dtype)


def column(unit: str, source: str, **more: Any) -> Any:
    """A field of ``Ticks`` that is a ``Column``."""
    return field(default=None, metadata={"column": Column(unit, source, **more)})


def columns_of(table: type) -> tuple[Column, ...]:
    """The columns of a class, those of the chain first."""
    found = (replace(each.metadata["column"], name=each.name) for each in fields(table) if "column" in each.metadata)
    named = (replace(each, told_as=each.told_as or each.name, reading=each.reading or each.source) for each in found)
    return tuple(sorted(named, key=lambda each: not each.in_chain))
