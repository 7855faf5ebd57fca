"""Which entries of the datalog are what a sensor or a wheel really read: a program may print any number.

The readings are the simulator's own records; what the genuine entries are worth is judged in ``logged.py``.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from sim.recording import Datum, Recording
from submissions.criteria.logged import Instrument

#: How old a reading may be when it is printed, seconds.
_AGE = 0.5
#: How far a printed number may be from the reading, in the unit in which it was printed: it may have been rounded.
_ROUNDED = 1.0
#: What a reading of a sensor takes, seconds; what is printed sooner after another sample repeats it.
_READING = 0.01


def measured_only(samples: Sequence[Datum], instrument: Instrument, recording: Recording) -> list[Datum]:
    """The samples that the instrument read in the half second before they were printed, in any unit of the brick's.

    Of those that were printed in less time than a reading takes only the first counts.

    Units: of light 0..255 and 0..100, for each colour and for all three together; of distance mm, cm and inches;
    of turning degrees. Nothing has been read before the first tick.
    """
    readings = _readings(instrument, recording)
    if not len(readings):
        return []
    found: list[Datum] = []
    for datum in samples:
        if _was_read(datum, readings) and not (found and datum.t < found[-1].t + _READING - 1e-9):
            found.append(datum)
    return found


def _was_read(datum: Datum, readings: NDArray[np.float64]) -> bool:
    last = min(max(int(datum.t * 30 + 1e-6), 1), len(readings))
    first = min(max(int((datum.t - _AGE) * 30), 1), last)
    return bool((np.abs(readings[first - 1 : last] - datum.value) <= _ROUNDED).any())


def _readings(instrument: Instrument, recording: Recording) -> NDArray[np.float64]:
    """One row a tick, one column for each unit in which it may be printed."""
    ticks = recording.ticks
    match instrument:
        case "left light" | "right light":
            rgb = ticks.left_rgb if instrument == "left light" else ticks.right_rgb
            together = rgb.sum(axis=1)
            return np.column_stack([rgb, rgb / 2.55, together / 3, together / 7.65])
        case "ultrasonic":
            return np.column_stack([ticks.ultrasonic, ticks.ultrasonic / 10, ticks.ultrasonic / 25.4])
        case "gyro":
            return ticks.gyro[:, None]
        case "left wheel":
            return np.column_stack([ticks.left_position, ticks.left_position / 360])
        case "right wheel":
            return np.column_stack([ticks.right_position, ticks.right_position / 360])
