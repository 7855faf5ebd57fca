"""Judging how often the path goes round a point, and how the gyro changes on the way.

The winding number is the angle under which the path is seen from the point, in whole turns.
"""

from __future__ import annotations

from fractions import Fraction

import numpy as np

from service.grading.grade import Measure, TrialResult
from service.grading.judging.outcome import Outcome, failed, passed
from service.grading.judging.whereabouts import headings, place_at, positions, stretches
from sim.recording import Floats
from submissions.criteria.path import Circuits

#: The gyro is smoothed over so many rows (1 s) before corners are looked for.
_SMOOTH = 31
#: Going straight on for so many rows (0.5 s) parts two corners.
_LASTING = 15
#: An upper bound of so many rounds is none.
_NO_BOUND = 100
#: A lesser change of heading is no corner, degrees.
_CORNER = 30.0


def judge_circuits(criterion: Circuits, trial: TrialResult) -> Outcome:
    recording = trial.recording
    round_it = rounds(positions(recording, criterion.of), criterion.x, criterion.y)
    times = float(abs(round_it[-1])) if len(round_it) else 0.0
    measures = [Measure("times round", times)]
    point, end = f"({criterion.x:g}, {criterion.y:g})", (recording.end_t, recording.end)
    low, high = criterion.times
    wanted = f"{low:g} times" if low == high else f"{low:g} to {high:g} times"
    if high >= _NO_BOUND:
        wanted = "at least once" if low == 1 else f"at least {low:g} times"
    if criterion.direction != "either" and times >= 0.5:
        went = "anticlockwise" if round_it[-1] > 0 else "clockwise"
        if went != criterion.direction:
            return failed(
                f"Expected the path to go {criterion.direction} round {point}, but it went {went}.",
                *end,
                measures=tuple(measures),
            )
    if not low <= times <= high:
        drawn = "" if len(round_it) else "; the pen was never down, which -p in the program's magic line does"
        score = Fraction(min(times / low, 1.0) if low else 0.0).limit_denominator(1000)
        return failed(
            f"Expected the path to go {wanted} round {point}, but it went {times:.2f} times{drawn}.",
            *end,
            score=score,
            measures=tuple(measures),
        )
    nearest = float(
        np.nanmin(np.hypot(*(positions(recording, criterion.of) - (criterion.x, criterion.y)).T), initial=np.inf)
    )
    if nearest < criterion.clear_of:
        return failed(
            f"Expected the path to keep {criterion.clear_of:g} mm clear of {point}, but it came as near as "
            f"{nearest:.0f} mm.",
            *end,
            measures=tuple(measures),
        )
    for number, (first, last) in enumerate(_whole_rounds(round_it), 1):
        turned = headings(recording)[first : last + 1]
        change = float(abs(turned[-1] - turned[0]))
        corners = _corners(turned)
        measures += [Measure(f"gyro in round {number}", change, "°"), Measure(f"corners in round {number}", corners)]
        if criterion.gyro is not None and not criterion.gyro[0] <= change <= criterion.gyro[1]:
            return failed(
                f"Expected the gyro to change by {criterion.gyro[0]:g}° to {criterion.gyro[1]:g}° in each round, "
                f"but in round {number} it changed by {change:.0f}°.",
                *place_at(recording, last),
                measures=tuple(measures),
            )
        if criterion.corners is not None and corners != criterion.corners:
            return failed(
                f"Expected the gyro to change in {criterion.corners} steps in each round, "
                f"but in round {number} there were {corners}.",
                *place_at(recording, last),
                measures=tuple(measures),
            )
    return passed(f"The path went {times:.2f} times round {point}.", *end, tuple(measures))


def rounds(points: Floats, x: float, y: float) -> Floats:
    """How often the path has gone round (x, y) at each row since its first, anticlockwise above 0.

    Rows that are NaN (where the pen was up) are left out.
    """
    drawn = points[~np.isnan(points[:, 0])]
    if not len(drawn):
        return np.zeros(0)
    angles = np.unwrap(np.arctan2(drawn[:, 1] - y, drawn[:, 0] - x))
    return np.asarray((angles - angles[0]) / (2 * np.pi))


def _whole_rounds(round_it: Floats) -> list[tuple[int, int]]:
    """First and last row of each whole round."""
    farthest = np.maximum.accumulate(np.abs(round_it))
    ends = np.searchsorted(farthest, np.arange(1, int(farthest.max(initial=0.0)) + 1)).tolist()
    return list(zip([0, *ends], ends, strict=False))


def _corners(turned: Floats) -> int:
    """In how many steps the heading changes: parts in which it turns faster than on average, 0.5 s or more apart."""
    if len(turned) <= _SMOOTH:
        return 0
    smooth = np.convolve(turned, np.ones(_SMOOTH) / _SMOOTH, mode="valid")
    rate = np.diff(smooth) * np.sign(turned[-1] - turned[0])
    fast = rate > rate.mean()
    for first, last in stretches(~fast):
        if last - first < _LASTING and first > 0 and last < len(fast):
            fast[first:last] = True
    return sum(abs(float(smooth[last] - smooth[first])) >= _CORNER for first, last in stretches(fast))
