"""Which lines of a report count: those in a zone, and those after a reading of a light sensor.

``reporting.py`` judges what they say.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from types import MappingProxyType

import numpy as np

from service.grading.judging.geometry import describe_zone, is_in_zone, locate_part_at_time
from service.language import translatable
from sim.recording import Recording, TimedText
from sim.sentences import Sentence
from submissions.criteria.reporting import Reading, Reports

_LATE_REPORTS: Mapping[str, str] = MappingProxyType(
    {
        "left": translatable(
            "it reported nothing after the left light sensor had read %(least)g to %(most)g %% reflected light"
        ),
        "right": translatable(
            "it reported nothing after the right light sensor had read %(least)g to %(most)g %% reflected light"
        ),
    }
)
_LATE_PLACED_REPORTS: Mapping[str, str] = MappingProxyType(
    {
        "left": translatable(
            "it reported nothing at %(zone)s after the left light sensor had read %(least)g to %(most)g %% reflected "
            "light"
        ),
        "right": translatable(
            "it reported nothing at %(zone)s after the right light sensor had read %(least)g to %(most)g %% reflected "
            "light"
        ),
    }
)


def select_counting_lines(criterion: Reports, lines: Sequence[TimedText], recording: Recording) -> list[TimedText]:
    """Return the lines that meet the criterion's conditions on place and time."""
    start = _find_reading_time(criterion.after, recording) if criterion.after is not None else 0.0
    return [line for line in lines if line.t >= start - 1e-9 and _is_placed(criterion, line, recording)]


def describe_uncounted_report(criterion: Reports, expectation: str) -> str:
    """Return the sentence on a report of which no line counts."""
    return Sentence("%(expected)s, but %(actual)s.", expected=expectation, actual=_describe_condition(criterion))


def _describe_condition(criterion: Reports) -> str:
    if criterion.after is None:
        assert criterion.zone is not None
        return Sentence(
            "it reported nothing while the left light sensor was at %(zone)s", zone=describe_zone(criterion.zone)
        )
    least, most = criterion.after.reflected
    if criterion.zone is None:
        return Sentence(_LATE_REPORTS[criterion.after.light], least=least, most=most)
    return Sentence(
        _LATE_PLACED_REPORTS[criterion.after.light], least=least, most=most, zone=describe_zone(criterion.zone)
    )


def _is_placed(criterion: Reports, line: TimedText, recording: Recording) -> bool:
    return criterion.zone is None or is_in_zone(locate_part_at_time(recording, "left", line.t), criterion.zone)


def _find_reading_time(reading: Reading, recording: Recording) -> float:
    """Return when the sensor first read so, in seconds; infinity if it never did."""
    ticks = recording.ticks
    rgb = ticks.left_rgb if reading.light == "left" else ticks.right_rgb
    least, most = reading.reflected
    # The sensor's reflected light is the red part.
    percent = rgb[:, 0] / 2.55
    rows = np.flatnonzero((percent >= least - 0.01) & (percent <= most + 0.01))
    return float(ticks.t[rows[0]]) if len(rows) else math.inf
