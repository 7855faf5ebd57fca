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
    moving = np.flatnonzero(~compute_still_mask(recording))
    rows = moving[np.unique(np.linspace(0, len(moving) - 1, _MAX_MOMENTS).astype(int))] if len(moving) else moving
    t, end = recording.end_t, recording.end
    lower = "lower" if criterion.goes == "with" else "higher"
    asked = f"Expected {criterion.of} to be {lower} where {criterion.to} is lower"
    if len(rows) < 2:
        return fail_with(f"{asked}, but the robot hardly moved.", t, end)
    of, to = _read_series(criterion.of, recording)[rows], _read_series(criterion.to, recording)[rows]
    alike, differing = _count_agreeing_pairs(of, to if criterion.goes == "with" else -to)
    share = Fraction(alike, differing) if differing else Fraction(0)
    measures = (
        Measure("share of pairs", float(share)),
        Measure("least", float(of.min())),
        Measure("most", float(of.max())),
    )
    span = f"it was from {of.min():.3g} to {of.max():.3g} while the robot moved"
    if np.ptp(of) < criterion.changes or not differing:
        by = f" by {criterion.changes:g} or more" if criterion.changes else ""
        return fail_with(
            f"Expected {criterion.of} to change with {criterion.to}{by}, but {span}.", t, end, measures=measures
        )
    told = f"true for {float(share):.0%} of all pairs of moments"
    if share >= Fraction(str(criterion.at_least)):
        return pass_with(f"As expected, {criterion.of} was {lower} where {criterion.to} was: {told}.", t, end, measures)
    return fail_with(
        f"{asked} in {criterion.at_least:.0%} or more of all pairs of moments, but this was true for "
        f"{float(share):.0%}; {span}.",
        t,
        end,
        share / Fraction(str(criterion.at_least)),
        measures,
    )


def _count_agreeing_pairs(of: Floats, to: Floats) -> tuple[int, int]:
    """Return the number of pairs in which both series differ in the same direction, and in which both differ."""
    one, other = np.triu_indices(len(of), 1)
    by_of, by_to = of[one] - of[other], to[one] - to[other]
    both = (np.abs(by_of) > _EQUAL_TOLERANCE * np.ptp(of)) & (np.abs(by_to) > _EQUAL_TOLERANCE * np.ptp(to))
    return int((both & (by_of * by_to > 0)).sum()), int(both.sum())


def _read_series(name: Series, recording: Recording) -> Floats:
    """Return a value for each tick, shape (n,)."""
    ticks = recording.ticks
    ahead, turned = compute_travel(recording)
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
            return np.abs(ahead) * ticks.per_second
        case "turning":
            return np.abs(turned) * ticks.per_second
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
