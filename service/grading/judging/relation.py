"""Judging of the correlation between two series of a recording.

All values come from the simulator. The program's use of them is judged elsewhere.
"""

from __future__ import annotations

from fractions import Fraction

import numpy as np

from service.grading.grade import Measure, TrialResult
from service.grading.judging.geometry import compute_headings, compute_still_mask, compute_times, compute_travel
from service.grading.judging.judge_declaration import declare_judge
from service.grading.judging.outcome import Outcome, fail_with, pass_with
from sim.recording import Floats, Recording
from submissions.criteria.relation import Relation, Series

#: The number of moments that are compared pairwise.
_MAX_MOMENTS = 600
#: Differences below this fraction of a series' range are ignored.
_EQUAL_TOLERANCE = 0.05


@declare_judge(Relation)
def judge_relation(criterion: Relation, trial: TrialResult) -> Outcome:
    """Judge the fraction of pairs of moments with the required relation. The score compares it with the target."""
    recording = trial.recording
    moving_ticks = np.flatnonzero(~compute_still_mask(recording))
    rows = (
        moving_ticks[np.unique(np.linspace(0, len(moving_ticks) - 1, _MAX_MOMENTS).astype(int))]
        if len(moving_ticks)
        else moving_ticks
    )
    t, end = recording.end_t, recording.end
    lower = "lower" if criterion.goes == "with" else "higher"
    expectation = f"Expected {criterion.of} to be {lower} where {criterion.to} is lower"
    if len(rows) < 2:
        return fail_with(f"{expectation}, but the robot hardly moved.", t, end)
    checked_values, reference_values = (
        _read_series(criterion.of, recording)[rows],
        _read_series(criterion.to, recording)[rows],
    )
    agreeing_pairs, differing_pairs = _count_agreeing_pairs(
        checked_values, reference_values if criterion.goes == "with" else -reference_values
    )
    share = Fraction(agreeing_pairs, differing_pairs) if differing_pairs else Fraction(0)
    measures = (
        Measure("share of pairs", float(share)),
        Measure("least", float(checked_values.min())),
        Measure("most", float(checked_values.max())),
    )
    span = f"it was from {checked_values.min():.3g} to {checked_values.max():.3g} while the robot moved"
    if np.ptp(checked_values) < criterion.changes or not differing_pairs:
        amount_clause = f" by {criterion.changes:g} or more" if criterion.changes else ""
        return fail_with(
            f"Expected {criterion.of} to change with {criterion.to}{amount_clause}, but {span}.",
            t,
            end,
            measures=measures,
        )
    result_text = f"true for {float(share):.0%} of all pairs of moments"
    if share >= Fraction(str(criterion.at_least)):
        return pass_with(
            f"As expected, {criterion.of} was {lower} where {criterion.to} was: {result_text}.", t, end, measures
        )
    return fail_with(
        f"{expectation} in {criterion.at_least:.0%} or more of all pairs of moments, but this was true for "
        f"{float(share):.0%}; {span}.",
        t,
        end,
        share / Fraction(str(criterion.at_least)),
        measures,
    )


def _count_agreeing_pairs(checked_values: Floats, reference_values: Floats) -> tuple[int, int]:
    """Return the number of pairs in which both series differ in the same direction, and in which both differ."""
    first_indices, second_indices = np.triu_indices(len(checked_values), 1)
    checked_differences, reference_differences = (
        checked_values[first_indices] - checked_values[second_indices],
        reference_values[first_indices] - reference_values[second_indices],
    )
    is_different = (np.abs(checked_differences) > _EQUAL_TOLERANCE * np.ptp(checked_values)) & (
        np.abs(reference_differences) > _EQUAL_TOLERANCE * np.ptp(reference_values)
    )
    return int((is_different & (checked_differences * reference_differences > 0)).sum()), int(is_different.sum())


def _read_series(name: Series, recording: Recording) -> Floats:
    """Return a value for each tick, shape (n,)."""
    ticks = recording.ticks
    forward_steps, turns = compute_travel(recording)
    match name:
        case "time":
            return compute_times(recording)[1:]
        case "x":
            return ticks.x
        case "y":
            return ticks.y
        case "heading":
            return compute_headings(recording)[1:]
        case "speed":
            return np.abs(forward_steps) * ticks.per_second
        case "turning":
            return np.abs(turns) * ticks.per_second
        case "left wheel speed" | "right wheel speed":
            wheel = ticks.left_position if name == "left wheel speed" else ticks.right_position
            return np.abs(np.diff(wheel, prepend=0.0)) * ticks.per_second
        case "left light" | "right light":
            rgb = ticks.left_rgb if name == "left light" else ticks.right_rgb
            return np.asarray(rgb[:, 0] / 2.55)
        case "ultrasonic":
            return ticks.ultrasonic
        case "gyro":
            return ticks.gyro
