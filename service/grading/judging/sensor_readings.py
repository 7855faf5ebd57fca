"""Comparison of a program's printed numbers with recent sensor readings, in any unit.

A match does not show what the reading was for. The modules of the families judge that.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import get_args

import numpy as np
from numpy.typing import NDArray

from sim.recording import Floats, Recording
from sim.recording_values import count_ticks_until
from submissions.criteria.logs import Instrument

#: The largest age of a reading when it is printed, seconds.
_MAX_AGE_SECONDS = 0.5
#: The largest difference of a printed number from the reading, in the printed unit, to allow for rounding.
_ROUNDING = 1.0
INSTRUMENTS: tuple[Instrument, ...] = get_args(Instrument)


def match_readings(
    values: Sequence[float], times: Sequence[float], instruments: Sequence[Instrument], recording: Recording
) -> NDArray[np.bool_]:
    """Return whether an instrument read each value in the half second before its time, shape (len(values),).

    Units: light 0..255 and 0..100, for each colour and for all three together; distance in mm, cm and inches; turning
    in degrees. There are no readings before the first tick.
    """
    is_read = np.zeros(len(values), dtype=bool)
    if not len(recording.ticks) or not len(values):
        return is_read
    numbers = np.asarray(values, dtype=np.float64)
    last_ticks = np.clip([count_ticks_until(recording, t) for t in times], 1, len(recording.ticks))
    first_ticks = np.clip([int((t - _MAX_AGE_SECONDS) * recording.ticks.per_second) for t in times], 1, last_ticks)
    columns = np.column_stack([column for each in instruments for column in _collect_reading_columns(each, recording)])
    for offset in range(int(np.max(last_ticks - first_ticks)) + 1):
        rows = np.maximum(last_ticks - offset, first_ticks) - 1
        for column in columns.T:
            is_read |= np.abs(column[rows] - numbers) <= _ROUNDING
    return is_read


def _collect_reading_columns(instrument: Instrument, recording: Recording) -> list[Floats]:
    """Return the readings after each tick, in each unit in which they may be printed."""
    ticks = recording.ticks
    match instrument:
        case "left light" | "right light":
            rgb = ticks.left_rgb if instrument == "left light" else ticks.right_rgb
            together = rgb.sum(axis=1)
            return [*rgb.T, *(rgb / 2.55).T, together / 3, together / 7.65]
        case "ultrasonic":
            return [ticks.ultrasonic, ticks.ultrasonic / 10, ticks.ultrasonic / 25.4]
        case "gyro":
            return [ticks.gyro]
        case "left wheel":
            return [ticks.left_position, ticks.left_position / 360]
        case "right wheel":
            return [ticks.right_position, ticks.right_position / 360]
