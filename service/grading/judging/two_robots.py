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
    last = len(distances) - 1
    first = last if criterion.when == "end" else min(count_ticks_until(recording, criterion.after), last)
    looked_at = distances[first:]
    good = (looked_at >= criterion.at_least) & (looked_at <= (criterion.at_most or np.inf))
    share = Fraction(int(good.sum()), len(good))
    measures = (
        Measure("apart at the end", float(distances[last]), "mm"),
        Measure("least apart", float(looked_at.min()), "mm"),
        Measure("most apart", float(looked_at.max()), "mm"),
        Measure("share of the time", float(share) * 100, "%"),
    )
    expected = f"Expected the robots to be {_describe_expected(criterion)}"
    if criterion.when == "always":
        needed = "all" if criterion.share == 1 else f"{criterion.share * 100:g}%"
        told = (
            f"this was true for {float(share) * 100:.0f}% of the time after {tick_to_seconds(recording, first):.2f} s"
        )
        at = first + int(np.argmin(good))
        if share >= Fraction(str(criterion.share)):
            return pass_with(
                f"The robots were {_describe_expected(criterion)}: {told}.",
                tick_to_seconds(recording, last),
                recording.end,
                measures,
            )
        return fail_with(
            f"{expected} for {needed} of the time, but {told}; at {tick_to_seconds(recording, at):.2f} s they were "
            f"{distances[at]:.0f} mm apart.",
            tick_to_seconds(recording, at),
            get_pose_after(recording, at),
            share,
            measures,
        )
    at = first + int(np.argmax(good))
    if good.any():
        told = f"at {tick_to_seconds(recording, at):.2f} s the robots were {distances[at]:.0f} mm apart"
        return pass_with(
            f"{told.capitalize()}.", tick_to_seconds(recording, at), get_pose_after(recording, at), measures
        )
    began = tick_to_seconds(recording, first)
    ends = "at the end" if criterion.when == "end" else f"at some time after {began:.2f} s"
    nearest = f"{distances[last]:.0f} mm" if criterion.when == "end" else _format_span(looked_at)
    return fail_with(
        f"{expected} {ends}, but they were {nearest} apart.",
        tick_to_seconds(recording, last),
        recording.end,
        measures=measures,
    )


def _compute_distances(recording: Recording) -> Floats | None:
    """Return the distance at the start and after each tick, mm; None if there is one robot."""
    if recording.partner is None:
        return None
    ways = [_collect_positions(recording), _collect_positions(recording.partner)]
    rows = max(len(way) for way in ways)
    first, second = (np.vstack((way, np.repeat(way[-1:], rows - len(way), axis=0))) for way in ways)
    distances: Floats = np.hypot(*(first - second).T)
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
