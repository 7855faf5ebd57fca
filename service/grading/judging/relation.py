"""Judging of the correlation between two series of a recording.

All values come from the simulator. The program's use of them is judged elsewhere.
"""

from __future__ import annotations

from collections.abc import Mapping
from fractions import Fraction
from types import MappingProxyType

import numpy as np

from service.grading.grade import Measure, TrialResult
from service.grading.judging.geometry import compute_headings, compute_still_mask, compute_times, compute_travel
from service.grading.judging.judge_declaration import declare_judge
from service.grading.judging.outcome import Outcome, fail_with, pass_with
from service.language import translatable
from sim.recording import Floats, Recording
from sim.sentences import Sentence
from submissions.criteria.relation import Relation, Series

#: The number of moments that are compared pairwise.
_MAX_MOMENTS = 600
#: Differences below this fraction of a series' range are ignored.
_EQUAL_TOLERANCE = 0.05
_SERIES: Mapping[Series, str] = MappingProxyType(
    {
        "time": translatable("time"),
        "x": translatable("x"),
        "y": translatable("y"),
        "heading": translatable("heading"),
        "speed": translatable("speed"),
        "turning": translatable("turning"),
        "left wheel speed": translatable("left wheel speed"),
        "right wheel speed": translatable("right wheel speed"),
        "left light": translatable("left light"),
        "right light": translatable("right light"),
        "ultrasonic": translatable("ultrasonic"),
        "gyro": translatable("gyro"),
    }
)
#: By whether the values go with or against the others: the beginning of a failure, and the whole of a success.
_EXPECTATIONS: Mapping[str, tuple[str, str]] = MappingProxyType(
    {
        "with": (
            translatable("Expected %(checked)s to be lower where %(reference)s is lower"),
            translatable(
                "As expected, %(checked)s was lower where %(reference)s was: true for %(share)s of all pairs of "
                "moments."
            ),
        ),
        "against": (
            translatable("Expected %(checked)s to be higher where %(reference)s is lower"),
            translatable(
                "As expected, %(checked)s was higher where %(reference)s was: true for %(share)s of all pairs of "
                "moments."
            ),
        ),
    }
)


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
    checked, reference = Sentence(_SERIES[criterion.of]), Sentence(_SERIES[criterion.to])
    failure, success = _EXPECTATIONS[criterion.goes]
    expectation = Sentence(failure, checked=checked, reference=reference)
    if len(rows) < 2:
        return fail_with(Sentence("%(expectation)s, but the robot hardly moved.", expectation=expectation), t, end)
    checked_values, reference_values = (
        _read_series(criterion.of, recording)[rows],
        _read_series(criterion.to, recording)[rows],
    )
    agreeing_pairs, differing_pairs = _count_agreeing_pairs(
        checked_values, reference_values if criterion.goes == "with" else -reference_values
    )
    share = Fraction(agreeing_pairs, differing_pairs) if differing_pairs else Fraction(0)
    measures = (
        Measure(Sentence("share of pairs"), float(share)),
        Measure(Sentence("least"), float(checked_values.min())),
        Measure(Sentence("most"), float(checked_values.max())),
    )
    span = Sentence(
        "it was from %(least).3g to %(most).3g while the robot moved",
        least=float(checked_values.min()),
        most=float(checked_values.max()),
    )
    if np.ptp(checked_values) < criterion.changes or not differing_pairs:
        template = (
            translatable("Expected %(checked)s to change with %(reference)s by %(least)g or more, but %(span)s.")
            if criterion.changes
            else translatable("Expected %(checked)s to change with %(reference)s, but %(span)s.")
        )
        return fail_with(
            Sentence(template, checked=checked, reference=reference, least=criterion.changes, span=span),
            t,
            end,
            measures=measures,
        )
    share_text = f"{float(share):.0%}"
    if share >= Fraction(str(criterion.at_least)):
        message = Sentence(success, checked=checked, reference=reference, share=share_text)
        return pass_with(message, t, end, measures)
    return fail_with(
        Sentence(
            "%(expectation)s in %(required)s or more of all pairs of moments, but this was true for %(share)s; "
            "%(span)s.",
            expectation=expectation,
            required=f"{criterion.at_least:.0%}",
            share=share_text,
            span=span,
        ),
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
