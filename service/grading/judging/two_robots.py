"""Judging of the distance between two robots.

The other modules judge each robot's own path.
"""

from __future__ import annotations

from fractions import Fraction

import numpy as np

from service.grading.grade import Measure, TrialResult
from service.grading.judging.judge_declaration import declare_judge
from service.grading.judging.outcome import Outcome, fail_with, pass_with
from sim.recording import Floats, Recording
from sim.recording_values import count_ticks_until, get_pose_after, tick_to_seconds
from submissions.criteria.two_robots import Apart


@declare_judge(Apart)
def judge_apart(criterion: Apart, trial: TrialResult) -> Outcome:
    """Judge the distance after each tick until the last program ends. A robot stops when its program ends."""
    recording = trial.recording
    distances = _compute_distances(recording)
    if distances is None:
        return fail_with("Expected two robots, but there was one.")
    last_row = len(distances) - 1
    first_row = last_row if criterion.when == "end" else min(count_ticks_until(recording, criterion.after), last_row)
    counted_distances = distances[first_row:]
    is_right = (counted_distances >= criterion.at_least) & (counted_distances <= (criterion.at_most or np.inf))
    share = Fraction(int(is_right.sum()), len(is_right))
    measures = (
        Measure("apart at the end", float(distances[last_row]), "mm"),
        Measure("least apart", float(counted_distances.min()), "mm"),
        Measure("most apart", float(counted_distances.max()), "mm"),
        Measure("share of the time", float(share) * 100, "%"),
    )
    expected = f"Expected the robots to be {_describe_expected(criterion)}"
    if criterion.when == "always":
        required_share = "all" if criterion.share == 1 else f"{criterion.share * 100:g}%"
        start = tick_to_seconds(recording, first_row)
        summary = f"this was true for {float(share) * 100:.0f}% of the time after {start:.2f} s"
        row = first_row + int(np.argmin(is_right))
        if share >= Fraction(str(criterion.share)):
            return pass_with(
                f"The robots were {_describe_expected(criterion)}: {summary}.",
                tick_to_seconds(recording, last_row),
                recording.end,
                measures,
            )
        return fail_with(
            f"{expected} for {required_share} of the time, but {summary}; at {tick_to_seconds(recording, row):.2f} s "
            f"they were {distances[row]:.0f} mm apart.",
            tick_to_seconds(recording, row),
            get_pose_after(recording, row),
            share,
            measures,
        )
    row = first_row + int(np.argmax(is_right))
    if is_right.any():
        summary = f"at {tick_to_seconds(recording, row):.2f} s the robots were {distances[row]:.0f} mm apart"
        return pass_with(
            f"{summary.capitalize()}.", tick_to_seconds(recording, row), get_pose_after(recording, row), measures
        )
    start_time = tick_to_seconds(recording, first_row)
    time_clause = "at the end" if criterion.when == "end" else f"at some time after {start_time:.2f} s"
    distance_text = f"{distances[last_row]:.0f} mm" if criterion.when == "end" else _format_span(counted_distances)
    return fail_with(
        f"{expected} {time_clause}, but they were {distance_text} apart.",
        tick_to_seconds(recording, last_row),
        recording.end,
        measures=measures,
    )


def _compute_distances(recording: Recording) -> Floats | None:
    """Return the distance at the start and after each tick, mm; None if there is one robot."""
    if recording.partner is None:
        return None
    paths = [_collect_positions(recording), _collect_positions(recording.partner)]
    rows = max(len(way) for way in paths)
    first_path, second_path = (np.vstack((way, np.repeat(way[-1:], rows - len(way), axis=0))) for way in paths)
    distances: Floats = np.hypot(*(first_path - second_path).T)
    return distances


def _collect_positions(recording: Recording) -> Floats:
    ticks = recording.ticks
    start = [[recording.start.x, recording.start.y]]
    return np.vstack((start, np.column_stack((ticks.x, ticks.y)))) if len(ticks) else np.array(start)


def _describe_expected(criterion: Apart) -> str:
    if criterion.at_most is None:
        return f"at least {criterion.at_least:g} mm apart"
    if criterion.at_least == 0:
        return f"within {criterion.at_most:g} mm of each other"
    return f"{criterion.at_least:g} to {criterion.at_most:g} mm apart"


def _format_span(distances: Floats) -> str:
    return f"{distances.min():.0f} to {distances.max():.0f} mm"
