"""Judging of line following and of lap times.

``geometry.py`` calculates the progress of the path along the line.
"""

from __future__ import annotations

from dataclasses import dataclass
from fractions import Fraction

import numpy as np

from service.grading.grade import Measure, TrialResult
from service.grading.judging.geometry import (
    LineProgress,
    compute_positions,
    find_place,
    measure_covered_share,
    track_line_progress,
)
from service.grading.judging.judge_declaration import declare_judge
from service.grading.judging.outcome import Outcome, fail_with, pass_with
from service.grading.judging.path import PART_NAMES
from sim.recording import Floats
from sim.recording_values import tick_to_seconds
from submissions.criteria.line import Follows, Laps


@declare_judge(Follows)
def judge_follows(criterion: Follows, trial: TrialResult) -> Outcome:
    """Judge the fraction of the line that was driven along, of the part that counts."""
    recording = trial.recording
    who, line = PART_NAMES[criterion.of], criterion.line.name
    found = track_line_progress(criterion.line, compute_positions(recording, criterion.of), criterion.within)
    if found is None:
        return fail_with(
            f"Expected {who} to follow {line}, but it never came within {criterion.within:g} mm of it.",
            recording.end_t,
            recording.end,
        )
    begin, end = _find_counted_range(criterion, found)
    share = measure_covered_share(found, criterion.within, begin, end)
    on_it = _count_rows_to_end(found, end)
    offsets = np.abs(found.offset[:on_it])
    farthest = int(np.argmax(offsets))
    one_side = _measure_one_side_share(found.offset[:on_it])
    measures = (
        Measure("share covered", share),
        Measure("farthest off", float(offsets[farthest]), "mm"),
        Measure("mean off", float(offsets.mean()), "mm"),
        Measure("seconds to the end", tick_to_seconds(recording, found.first + on_it - 1), "s"),
        Measure("share on one side", one_side),
    )
    score = Fraction(min(share / criterion.covers, 1.0)).limit_denominator(1000)
    if criterion.at_most is not None and offsets[farthest] > criterion.at_most:
        return fail_with(
            f"Expected {who} to stay within {criterion.at_most:g} mm of {line}, "
            f"but it was {offsets[farthest]:.0f} mm off.",
            *find_place(recording, found.first + farthest),
            score=score,
            measures=measures,
        )
    if share < criterion.covers - 1e-9:
        met = float(found.progress[0])
        late = f"reached it only at {met / found.length:.0%} of its length, and " if met > begin else ""
        return fail_with(
            f"Expected {who} to follow {criterion.covers:.0%} of {line} within {criterion.within:g} mm, "
            f"but it {late}followed {share:.0%} of it.",
            *find_place(recording, found.first + _find_last_on_line(found, criterion.within)),
            score=score,
            measures=measures,
        )
    if criterion.one_side is not None and one_side < criterion.one_side - 1e-9:
        return fail_with(
            f"Expected {who} to stay on one side of {line} for {criterion.one_side:.0%} of the time, "
            f"but it was on its main side for {one_side:.0%}.",
            *find_place(recording, found.first + on_it - 1),
            score=score,
            measures=measures,
        )
    return pass_with(
        f"{who[:1].upper()}{who[1:]} followed {share:.0%} of {line}, never more than {offsets[farthest]:.0f} mm off.",
        *find_place(recording, found.first + on_it - 1),
        measures,
    )


def _find_counted_range(criterion: Follows, found: LineProgress) -> tuple[float, float]:
    """Return the range of the line that counts, mm. Without a bound, its last mm alone could count as all of it."""
    met = float(found.progress[0])
    if criterion.line.is_closed:
        return met, met + found.length
    return min(met, criterion.joins_by * found.length), found.length


@dataclass(frozen=True, slots=True)
class Crossing:
    """A crossing of the start line, with the progress along the circuit."""

    t: float
    row: int
    progress: float


@declare_judge(Laps)
def judge_laps(criterion: Laps, trial: TrialResult) -> Outcome:
    """Judge laps, each from one crossing of the start line to a later one. The path is straight between ticks."""
    recording = trial.recording
    points = compute_positions(recording)
    found = track_line_progress(criterion.line, points, criterion.within)
    if found is None:
        return fail_with(
            f"Expected the robot to drive along {criterion.line.name}, but it never came within "
            f"{criterion.within:g} mm of it.",
            recording.end_t,
            recording.end,
        )
    crossings = _find_crossings(criterion, points, found, recording.ticks.per_second)
    laps, spoilt = find_complete_laps(criterion, found, crossings)
    off = float(np.abs(found.offset[: _find_last_row(found, crossings)]).max())
    driven = float(found.progress.max() - found.progress[0])
    measures = (
        *([Measure("lap time", min(lap for lap, _ in laps), "s")] if laps else []),
        Measure("laps", len(laps)),
        Measure("farthest off", off, "mm"),
        Measure("part of a lap", driven / found.length),
    )
    score = Fraction(min(max(driven / found.length, 0.0) / criterion.laps, 1.0)).limit_denominator(1000)
    if len(laps) < criterion.laps:
        if spoilt is not None:
            return fail_with(
                f"Expected {_describe_laps(criterion.laps)} within {criterion.within:g} mm of {criterion.line.name}, "
                f"but the robot was {abs(found.offset[spoilt]):.0f} mm off it.",
                *find_place(recording, found.first + spoilt),
                score=score,
                measures=measures,
            )
        return fail_with(
            f"Expected {_describe_laps(criterion.laps)} from start line to start line, but the robot drove "
            f"{max(driven, 0) / found.length:.0%} of a lap and crossed the start line "
            f"{len(crossings)} time{'' if len(crossings) == 1 else 's'}.",
            recording.end_t,
            recording.end,
            score=score,
            measures=measures,
        )
    best, row = min(laps)
    if criterion.seconds is not None and not criterion.seconds[0] <= best <= criterion.seconds[1]:
        return fail_with(
            f"Expected a lap in {criterion.seconds[0]:g} to {criterion.seconds[1]:g} s, "
            f"but the best took {best:.2f} s.",
            *find_place(recording, row),
            score=score,
            measures=measures,
        )
    return pass_with(
        f"The robot drove {_describe_laps(len(laps))}, the best in {best:.2f} s.", *find_place(recording, row), measures
    )


def _describe_laps(count: int) -> str:
    return "a whole lap" if count == 1 else f"{count} whole laps"


def _find_crossings(criterion: Laps, points: Floats, found: LineProgress, per_second: float) -> list[Crossing]:
    """Return each crossing of the start line in the circuit's direction. ``per_second`` is the rate of points."""
    x1, y1, x2, y2 = criterion.start_line
    first, line = np.array([x1, y1]), np.array([x2 - x1, y2 - y1])
    away = points - first
    # The side of the start line that each point is on, and the position along it.
    side = line[0] * away[:, 1] - line[1] * away[:, 0]
    place = away @ line / float(line @ line)
    crossings = []
    for row in range(found.first + 1, len(points)):
        if (side[row - 1] > 0) == (side[row] > 0):
            continue
        share = float(side[row - 1] / (side[row - 1] - side[row]))
        where = place[row - 1] + share * (place[row] - place[row - 1])
        before, after = found.progress[row - 1 - found.first], found.progress[row - found.first]
        if 0 <= where <= 1 and after > before:
            t = (row - 1 + share) / per_second
            crossings.append(Crossing(t, row, float(before + share * (after - before))))
    return crossings


def find_complete_laps(
    criterion: Laps, found: LineProgress, crossings: list[Crossing]
) -> tuple[list[tuple[float, int]], int | None]:
    """Return the time and last row of each complete lap, and the row where leaving the line spoilt a lap, if any.

    A lap begins at the last crossing from which it is complete, so it has the shortest time and the fewest ways to be
    spoilt. Laps don't overlap.
    """
    laps, spoilt = [], None
    free = 0
    for number, crossing in enumerate(crossings):
        whole = (
            begin
            for begin in reversed(crossings[free:number])
            if crossing.progress - begin.progress >= criterion.progress * found.length
        )
        begin = next(whole, None)
        if begin is None:
            continue
        rows = slice(begin.row - found.first, crossing.row - found.first + 1)
        off = np.abs(found.offset[rows])
        if off.max() <= criterion.within:
            laps.append((crossing.t - begin.t, crossing.row))
            free = number
        elif spoilt is None:
            spoilt = begin.row - found.first + int(np.argmax(off))
    return laps, spoilt


def _find_last_row(found: LineProgress, crossings: list[Crossing]) -> int:
    return crossings[-1].row - found.first + 1 if len(crossings) > 1 else len(found.offset)


def _count_rows_to_end(found: LineProgress, end: float) -> int:
    """Return the number of rows until the line's end was reached; all if it was not."""
    reached = np.flatnonzero(found.progress >= end - 1e-6)
    return int(reached[0]) + 1 if len(reached) else len(found.progress)


def _find_last_on_line(found: LineProgress, within: float) -> int:
    """Return the last row in which the robot was on the line."""
    return int(np.flatnonzero(np.abs(found.offset) <= within)[-1])


def _measure_one_side_share(offset: Floats) -> float:
    """Return the larger fraction of the rows on one side of the line; 1 if all are on the line."""
    left, right = int((offset > 0).sum()), int((offset < 0).sum())
    return max(left, right) / (left + right) if left + right else 1.0
