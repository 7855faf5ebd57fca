"""A recording's ticks, as short as JSON can be: whole numbers of a small step, each told by what it adds.

The table of columns says what there is; ``docs/replay.md`` says how it is read.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from sim.recording import COLUMNS, Ticks

#: Steps in one unit of a column; a canvas shows nothing smaller.
_FINE = frozenset({"x", "y", "heading"})
_STEPS_OF_FINE, _STEPS = 100, 10


def told_columns(ticks: Ticks) -> dict[str, dict[str, Any]]:
    """Every column of which anything is known, by the name that readers are told."""
    told = {}
    for each in COLUMNS:
        values = np.asarray(getattr(ticks, each.told_as), np.float64).reshape(len(ticks), each.width)
        if len(ticks) and np.isfinite(values).any():
            per = _STEPS_OF_FINE if each.name in _FINE else _STEPS
            told[each.told_as] = {"unit": each.unit, "per": per, "added": [_added(part, per) for part in values.T]}
    return told


def _added(values: NDArray[np.float64], per: int) -> list[int | None]:
    """What each value adds to the one before it, the first to nought; None where there is no value."""
    known = np.isfinite(values)
    steps = np.rint(np.where(known, values, 0) * per).astype(np.int64)
    added: list[int | None] = [None] * len(values)
    differences = np.diff(steps[known], prepend=0).tolist()
    for place, difference in zip(np.flatnonzero(known).tolist(), differences, strict=True):
        added[place] = difference
    return added
