"""Judging of the distance between two robots.

The other modules judge each robot's own path.
"""

from __future__ import annotations

from fractions import Fraction

import numpy as np

from service.grading.grade import Measure, TrialResult
from service.grading.judging.judge_declaration import declare_judge
from service.grading.judging.outcome import Outcome, fail_with, pass_with
from service.language import translatable
from sim.recording import Floats, Recording
from sim.recording_values import count_ticks_until, get_pose_after, tick_to_seconds
from sim.sentences import Sentence
from submissions.criteria.two_robots import Apart


@declare_judge(Apart)
def judge_apart(criterion: Apart, trial: TrialResult) -> Outcome:
    """Judge the distance after each tick until the last program ends. A robot stops when its program ends."""
    recording = trial.recording
    distances = _compute_distances(recording)
    if distances is None:
        return fail_with(Sentence("Expected two robots, but there was one."))
    last_row = len(distances) - 1
    first_row = last_row if criterion.when == "end" else min(count_ticks_until(recording, criterion.after), last_row)
    counted_distances = distances[first_row:]
    is_right = (counted_distances >= criterion.at_least) & (counted_distances <= (criterion.at_most or np.inf))
    share = Fraction(int(is_right.sum()), len(is_right))
    measures = (
        Measure(Sentence("apart at the end"), float(distances[last_row]), "mm"),
        Measure(Sentence("least apart"), float(counted_distances.min()), "mm"),
        Measure(Sentence("most apart"), float(counted_distances.max()), "mm"),
        Measure(Sentence("share of the time"), float(share) * 100, "%"),
    )
    distance_text = _describe_expected(criterion)
    if criterion.when == "always":
        summary = Sentence(
            "this was true for %(percent).0f%% of the time after %(start).2f s",
            percent=float(share) * 100,
            start=tick_to_seconds(recording, first_row),
        )
        row = first_row + int(np.argmin(is_right))
        if share >= Fraction(str(criterion.share)):
            return pass_with(
                Sentence("The robots were %(expected)s: %(summary)s.", expected=distance_text, summary=summary),
                tick_to_seconds(recording, last_row),
                recording.end,
                measures,
            )
        template = (
            translatable(
                "Expected the robots to be %(expected)s for all of the time, but %(summary)s; at %(seconds).2f s they "
                "were %(distance).0f mm apart."
            )
            if criterion.share == 1
            else translatable(
                "Expected the robots to be %(expected)s for %(percent)g%% of the time, but %(summary)s; at "
                "%(seconds).2f s they were %(distance).0f mm apart."
            )
        )
        return fail_with(
            Sentence(
                template,
                expected=distance_text,
                percent=criterion.share * 100,
                summary=summary,
                seconds=tick_to_seconds(recording, row),
                distance=float(distances[row]),
            ),
            tick_to_seconds(recording, row),
            get_pose_after(recording, row),
            share,
            measures,
        )
    row = first_row + int(np.argmax(is_right))
    if is_right.any():
        message = Sentence(
            "At %(seconds).2f s the robots were %(distance).0f mm apart.",
            seconds=tick_to_seconds(recording, row),
            distance=float(distances[row]),
        )
        return pass_with(message, tick_to_seconds(recording, row), get_pose_after(recording, row), measures)
    template = (
        translatable("Expected the robots to be %(expected)s at the end, but they were %(distance).0f mm apart.")
        if criterion.when == "end"
        else translatable(
            "Expected the robots to be %(expected)s at some time after %(start).2f s, but they were %(least).0f to "
            "%(most).0f mm apart."
        )
    )
    return fail_with(
        Sentence(
            template,
            expected=distance_text,
            distance=float(distances[last_row]),
            start=tick_to_seconds(recording, first_row),
            least=float(counted_distances.min()),
            most=float(counted_distances.max()),
        ),
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
        return Sentence("at least %(least)g mm apart", least=criterion.at_least)
    if criterion.at_least == 0:
        return Sentence("within %(most)g mm of each other", most=criterion.at_most)
    return Sentence("%(least)g to %(most)g mm apart", least=criterion.at_least, most=criterion.at_most)
