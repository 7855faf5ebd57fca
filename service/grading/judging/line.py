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
from service.grading.judging.path import describe_part
from service.language import translatable
from sim.recording import Floats
from sim.recording_values import tick_to_seconds
from sim.sentences import Sentence
from submissions.criteria.line import Follows, Laps
from submissions.criteria.places import LineToFollow


@declare_judge(Follows)
def judge_follows(criterion: Follows, trial: TrialResult) -> Outcome:
    """Judge the fraction of the line that was driven along, of the part that counts."""
    recording = trial.recording
    part_name, line = describe_part(criterion.of), _describe_line(criterion.line)
    line_progress = track_line_progress(criterion.line, compute_positions(recording, criterion.of), criterion.within)
    if line_progress is None:
        return fail_with(
            Sentence(
                "Expected %(part)s to follow %(line)s, but it never came within %(limit)g mm of it.",
                part=part_name,
                line=line,
                limit=criterion.within,
            ),
            recording.end_t,
            recording.end,
        )
    start, end = _find_counted_range(criterion, line_progress)
    share = measure_covered_share(line_progress, criterion.within, start, end)
    row_count = _count_rows_to_end(line_progress, end)
    offsets = np.abs(line_progress.offset[:row_count])
    farthest_row = int(np.argmax(offsets))
    one_side = _measure_one_side_share(line_progress.offset[:row_count])
    measures = (
        Measure(Sentence("share covered"), share),
        Measure(Sentence("farthest off"), float(offsets[farthest_row]), "mm"),
        Measure(Sentence("mean off"), float(offsets.mean()), "mm"),
        Measure(Sentence("seconds to the end"), tick_to_seconds(recording, line_progress.first + row_count - 1), "s"),
        Measure(Sentence("share on one side"), one_side),
    )
    score = Fraction(min(share / criterion.covers, 1.0)).limit_denominator(1000)
    if criterion.at_most is not None and offsets[farthest_row] > criterion.at_most:
        return fail_with(
            Sentence(
                "Expected %(part)s to stay within %(limit)g mm of %(line)s, but it was %(distance).0f mm off.",
                part=part_name,
                limit=criterion.at_most,
                line=line,
                distance=float(offsets[farthest_row]),
            ),
            *find_place(recording, line_progress.first + farthest_row),
            score=score,
            measures=measures,
        )
    if share < criterion.covers - 1e-9:
        start_position = float(line_progress.progress[0])
        template = (
            translatable(
                "Expected %(part)s to follow %(expected)s of %(line)s within %(limit)g mm, but it reached it only at "
                "%(start)s of its length, and followed %(share)s of it."
            )
            if start_position > start
            else translatable(
                "Expected %(part)s to follow %(expected)s of %(line)s within %(limit)g mm, but it followed %(share)s "
                "of it."
            )
        )
        return fail_with(
            Sentence(
                template,
                part=part_name,
                expected=f"{criterion.covers:.0%}",
                line=line,
                limit=criterion.within,
                start=f"{start_position / line_progress.length:.0%}",
                share=f"{share:.0%}",
            ),
            *find_place(recording, line_progress.first + _find_last_on_line(line_progress, criterion.within)),
            score=score,
            measures=measures,
        )
    if criterion.one_side is not None and one_side < criterion.one_side - 1e-9:
        return fail_with(
            Sentence(
                "Expected %(part)s to stay on one side of %(line)s for %(expected)s of the time, but it was on its "
                "main side for %(share)s.",
                part=part_name,
                line=line,
                expected=f"{criterion.one_side:.0%}",
                share=f"{one_side:.0%}",
            ),
            *find_place(recording, line_progress.first + row_count - 1),
            score=score,
            measures=measures,
        )
    return pass_with(
        Sentence(
            "%(part)s followed %(share)s of %(line)s, never more than %(distance).0f mm off.",
            part=describe_part(criterion.of, capitalised=True),
            share=f"{share:.0%}",
            line=line,
            distance=float(offsets[farthest_row]),
        ),
        *find_place(recording, line_progress.first + row_count - 1),
        measures,
    )


def _describe_line(line: LineToFollow) -> str:
    """Return the name of a line; the name of a line without its own can be translated."""
    return line.name if "name" in line.model_fields_set else Sentence("the line")


def _find_counted_range(criterion: Follows, line_progress: LineProgress) -> tuple[float, float]:
    """Return the range of the line that counts, mm. Without a bound, its last mm alone could count as all of it."""
    start_position = float(line_progress.progress[0])
    if criterion.line.is_closed:
        return start_position, start_position + line_progress.length
    return min(start_position, criterion.joins_by * line_progress.length), line_progress.length


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
    line_progress = track_line_progress(criterion.line, points, criterion.within)
    if line_progress is None:
        return fail_with(
            Sentence(
                "Expected the robot to drive along %(line)s, but it never came within %(limit)g mm of it.",
                line=_describe_line(criterion.line),
                limit=criterion.within,
            ),
            recording.end_t,
            recording.end,
        )
    crossings = _find_crossings(criterion, points, line_progress, recording.ticks.per_second)
    complete = find_complete_laps(criterion, line_progress, crossings)
    max_offset = float(np.abs(line_progress.offset[: _find_last_row(line_progress, crossings)]).max())
    driven_length = float(line_progress.progress.max() - line_progress.progress[0])
    measures = (
        *([Measure(Sentence("lap time"), min(lap.seconds for lap in complete.laps), "s")] if complete.laps else []),
        Measure(Sentence("laps"), complete.count),
        Measure(Sentence("farthest off"), max_offset, "mm"),
        Measure(Sentence("part of a lap"), driven_length / line_progress.length),
    )
    score = Fraction(min(max(driven_length / line_progress.length, 0.0) / criterion.laps, 1.0)).limit_denominator(1000)
    if complete.count < criterion.laps:
        if complete.spoilt_row is not None:
            return fail_with(
                Sentence(
                    "Expected %(laps)s within %(limit)g mm of %(line)s, but the robot was %(distance).0f mm off it.",
                    laps=_describe_laps(criterion.laps),
                    limit=criterion.within,
                    line=_describe_line(criterion.line),
                    distance=float(abs(line_progress.offset[complete.spoilt_row])),
                ),
                *find_place(recording, line_progress.first + complete.spoilt_row),
                score=score,
                measures=measures,
            )
        template = (
            translatable(
                "Expected %(laps)s from start line to start line, but the robot drove %(share)s of a lap and crossed "
                "the start line %(count)s time."
            )
            if len(crossings) == 1
            else translatable(
                "Expected %(laps)s from start line to start line, but the robot drove %(share)s of a lap and crossed "
                "the start line %(count)s times."
            )
        )
        return fail_with(
            Sentence(
                template,
                laps=_describe_laps(criterion.laps),
                share=f"{max(driven_length, 0) / line_progress.length:.0%}",
                count=len(crossings),
            ),
            recording.end_t,
            recording.end,
            score=score,
            measures=measures,
        )
    best = min(complete.laps, key=lambda lap: (lap.seconds, lap.end_row))
    if criterion.seconds is not None and not criterion.seconds[0] <= best.seconds <= criterion.seconds[1]:
        return fail_with(
            Sentence(
                "Expected a lap in %(least)g to %(most)g s, but the best took %(seconds).2f s.",
                least=criterion.seconds[0],
                most=criterion.seconds[1],
                seconds=best.seconds,
            ),
            *find_place(recording, best.end_row),
            score=score,
            measures=measures,
        )
    message = Sentence(
        "The robot drove %(laps)s, the best in %(seconds).2f s.",
        laps=_describe_laps(complete.count),
        seconds=best.seconds,
    )
    return pass_with(message, *find_place(recording, best.end_row), measures)


def _describe_laps(count: int) -> str:
    return Sentence("a whole lap") if count == 1 else Sentence("%(count)s whole laps", count=count)


def _find_crossings(criterion: Laps, points: Floats, line_progress: LineProgress, per_second: float) -> list[Crossing]:
    """Return each crossing of the start line in the circuit's direction. ``per_second`` is the rate of points."""
    x1, y1, x2, y2 = criterion.start_line
    line_start, line = np.array([x1, y1]), np.array([x2 - x1, y2 - y1])
    offsets = points - line_start
    # The side of the start line that each point is on, and the position along it.
    sides = line[0] * offsets[:, 1] - line[1] * offsets[:, 0]
    positions = offsets @ line / float(line @ line)
    crossings = []
    for row in range(line_progress.first + 1, len(points)):
        if (sides[row - 1] > 0) == (sides[row] > 0):
            continue
        share = float(sides[row - 1] / (sides[row - 1] - sides[row]))
        crossing_position = positions[row - 1] + share * (positions[row] - positions[row - 1])
        previous, following = (
            line_progress.progress[row - 1 - line_progress.first],
            line_progress.progress[row - line_progress.first],
        )
        if 0 <= crossing_position <= 1 and following > previous:
            t = (row - 1 + share) / per_second
            crossings.append(Crossing(t, row, float(previous + share * (following - previous))))
    return crossings


@dataclass(frozen=True, slots=True)
class Lap:
    """The duration of a complete lap in simulated time, and its last row."""

    seconds: float
    end_row: int


@dataclass(frozen=True, slots=True)
class CompleteLaps:
    """The complete laps, overlapping ones included, and the largest number of laps that do not overlap."""

    count: int
    laps: tuple[Lap, ...]
    spoilt_row: int | None  # where leaving the line spoilt a lap, if any


def find_complete_laps(criterion: Laps, line_progress: LineProgress, crossings: list[Crossing]) -> CompleteLaps:
    """Return the complete laps.

    A lap begins at the last crossing from which it is complete, so it has the shortest time and the fewest ways to be
    spoilt.
    """
    count, laps, spoilt_row = 0, [], None
    first_free = 0
    for number, crossing in enumerate(crossings):
        lap_starts = (
            begin
            for begin in reversed(range(number))
            if crossing.progress - crossings[begin].progress >= criterion.progress * line_progress.length
        )
        start_number = next(lap_starts, None)
        if start_number is None:
            continue
        lap_start = crossings[start_number]
        rows = slice(lap_start.row - line_progress.first, crossing.row - line_progress.first + 1)
        offsets = np.abs(line_progress.offset[rows])
        if offsets.max() <= criterion.within:
            laps.append(Lap(crossing.t - lap_start.t, crossing.row))
            if start_number >= first_free:
                count += 1
                first_free = number
        elif spoilt_row is None and start_number >= first_free:
            spoilt_row = lap_start.row - line_progress.first + int(np.argmax(offsets))
    return CompleteLaps(count, tuple(laps), spoilt_row)


def _find_last_row(line_progress: LineProgress, crossings: list[Crossing]) -> int:
    return crossings[-1].row - line_progress.first + 1 if len(crossings) > 1 else len(line_progress.offset)


def _count_rows_to_end(line_progress: LineProgress, end: float) -> int:
    """Return the number of rows until the line's end was reached; all if it was not."""
    reached_rows = np.flatnonzero(line_progress.progress >= end - 1e-6)
    return int(reached_rows[0]) + 1 if len(reached_rows) else len(line_progress.progress)


def _find_last_on_line(line_progress: LineProgress, max_distance: float) -> int:
    """Return the last row in which the robot was on the line."""
    return int(np.flatnonzero(np.abs(line_progress.offset) <= max_distance)[-1])


def _measure_one_side_share(offset: Floats) -> float:
    """Return the larger fraction of the rows on one side of the line; 1 if all are on the line."""
    left, right = int((offset > 0).sum()), int((offset < 0).sum())
    return max(left, right) / (left + right) if left + right else 1.0
