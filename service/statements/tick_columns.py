"""The ticks of a recording as texts, and the first tick at which two recordings differ.

Only the columns of the hash chain are included: they determine the recording's hash.
"""

from __future__ import annotations

import base64
import binascii
import zlib
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from sim.recording import COLUMNS, Ticks

#: More ticks than any trial has.
_MAX_TICKS = 1_000_000
_CHAINED = tuple(column for column in COLUMNS if column.in_chain)


@dataclass(frozen=True, slots=True)
class TickDifference:
    """The first tick at which two recordings differ, its time in seconds, the column, and both values.

    A value is None where that recording has ended.
    """

    tick: int
    seconds: float
    column: str
    before: float | None
    after: float | None


def encode_columns(ticks: Ticks) -> dict[str, str]:
    """Return each column as base64 of compressed bytes."""
    return {
        name: base64.b64encode(zlib.compress(values.tobytes(), 6)).decode("ascii")
        for name, values in _collect_columns(ticks).items()
    }


def find_difference(columns: Mapping[str, str], ticks: Ticks) -> TickDifference | None:
    """Return the first difference between encoded columns and ticks; None if they are equal.

    Columns that are missing or damaged are not compared.
    """
    differences = []
    for name, after in _collect_columns(ticks).items():
        before = _decode_column(columns.get(name, ""), after)
        if before is None:
            continue
        common = min(len(before), len(after))
        differing_ticks = np.flatnonzero((_to_bits(before[:common]) != _to_bits(after[:common])).any(axis=1))
        if len(differing_ticks) or len(before) != len(after):
            tick = int(differing_ticks[0]) if len(differing_ticks) else common
            differences.append((tick, name, before, after))
    if not differences:
        return None
    tick, name, before, after = min(differences, key=lambda each: each[0])
    return TickDifference(tick, (tick + 1) / ticks.per_second, name, *_read_values(before, after, tick))


def _read_values(before: NDArray[Any], after: NDArray[Any], tick: int) -> tuple[float | None, float | None]:
    """Return the values of the first component that differs at a tick."""
    if tick >= min(len(before), len(after)):
        return tuple(float(values[tick, 0]) if tick < len(values) else None for values in (before, after))  # type: ignore[return-value]
    rows = slice(tick, tick + 1)
    byte = int(np.flatnonzero(_to_bits(before[rows])[0] != _to_bits(after[rows])[0])[0])
    component = byte // before.dtype.itemsize
    return float(before[tick, component]), float(after[tick, component])


def _collect_columns(ticks: Ticks) -> dict[str, NDArray[Any]]:
    """Return the columns as arrays of shape (ticks, width), little-endian."""
    columns = {}
    for column in _CHAINED:
        values = np.asarray(getattr(ticks, column.name), np.dtype(column.dtype).newbyteorder("<"))
        columns[column.name] = np.ascontiguousarray(values.reshape(-1, column.width))
    return columns


def _decode_column(text: str, like: NDArray[Any]) -> NDArray[Any] | None:
    """Return a column with the type and width of another; None if it is missing or damaged."""
    row_bytes = like.dtype.itemsize * like.shape[1]
    try:
        compressed = base64.b64decode(text, validate=True)
        content = zlib.decompressobj().decompress(compressed, _MAX_TICKS * row_bytes)
    except (binascii.Error, ValueError, zlib.error):
        return None
    if not content or len(content) % row_bytes:
        return None
    return np.frombuffer(content, like.dtype).reshape(-1, like.shape[1])


def _to_bits(values: NDArray[Any]) -> NDArray[np.uint8]:
    """Return the bytes of each row, so that NaN equals itself."""
    return np.ascontiguousarray(values).view(np.uint8).reshape(len(values), -1)
