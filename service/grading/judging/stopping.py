"""Judging of what is under a light sensor when the robot stops.

A run ends at the last tick that was reached. Motors left on don't move the robot after its program has ended.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace
from fractions import Fraction
from types import MappingProxyType
from typing import Literal

import numpy as np

from service.grading.findings import OtherReading, StillRunning
from service.grading.grade import Measure, TrialResult
from service.grading.judging.geometry import (
    compute_still_mask,
    describe_zone,
    is_in_zone,
    locate_part,
    measure_floor_share,
)
from service.grading.judging.judge_declaration import declare_judge
from service.grading.judging.outcome import Outcome, fail_with, find_ending_fault, pass_with
from service.language import translatable
from sim.recording import Recording, Verdict
from sim.recording_values import tick_to_seconds
from sim.sentences import Sentence
from submissions.criteria.stopping import StopOn

Side = Literal["left", "right"]
_EXPECTATIONS: Mapping[str, str] = MappingProxyType(
    {
        "left": translatable("Expected the robot to stop with its left light sensor in place"),
        "right": translatable("Expected the robot to stop with its right light sensor in place"),
        "either": translatable("Expected the robot to stop with one of its light sensors in place"),
    }
)


@declare_judge(StopOn)
def judge_stop_on(criterion: StopOn, trial: TrialResult) -> Outcome:
    """Judge the light sensor's view where the robot stopped. Of two sensors, the better one counts."""
    recording = trial.recording
    fault = find_ending_fault(recording)
    if fault is not None and fault.verdict is not Verdict.PROGRAM_ERROR:
        end_t = recording.end_t
        message = Sentence(
            "%(expectation)s, but its program was still running after %(seconds).2f s.",
            expectation=Sentence(_EXPECTATIONS[criterion.sensor]),
            seconds=end_t,
        )
        outcome = fail_with(message, end_t, recording.end, findings=(StillRunning(),))
        return replace(outcome, has_end_reason=fault.verdict is Verdict.TIME_LIMIT)
    if not len(recording.ticks):
        return fail_with(
            Sentence(
                "%(expectation)s, but it never moved: no time passed.",
                expectation=Sentence(_EXPECTATIONS[criterion.sensor]),
            )
        )
    sides: tuple[Side, ...] = ("left", "right") if criterion.sensor == "either" else (criterion.sensor,)
    outcomes = [_judge_side(criterion, side, recording) for side in sides]
    return max(outcomes, key=lambda outcome: outcome.score)


def _judge_side(criterion: StopOn, side: Side, recording: Recording) -> Outcome:
    position = locate_part(recording, side, recording.end)
    rgb = (recording.ticks.left_rgb if side == "left" else recording.ticks.right_rgb)[-1]
    reading = 100 * int(rgb[0]) / 255
    reading_problem: tuple[str, str] | None = None
    checks: list[tuple[bool, str, str]] = []  # whether it holds, the expected value, the actual value
    position_text = Sentence("at (%(x).1f, %(y).1f)", x=position[0], y=position[1])
    # Everything off the floor is black, so the reading covers only the floor.
    floor_share = 1.0 if criterion.off_floor else measure_floor_share(recording, side, recording.end)
    if criterion.zone is not None:
        expectation = Sentence("at %(zone)s", zone=describe_zone(criterion.zone))
        checks.append((is_in_zone(position, criterion.zone), expectation, position_text))
    if criterion.near is not None:
        distance = math.dist(position, criterion.near)
        x, y = criterion.near
        expectation = Sentence("within %(limit)g mm of (%(x)g, %(y)g)", limit=criterion.within, x=x, y=y)
        distance_text = Sentence("%(position)s, %(distance).1f mm away", position=position_text, distance=distance)
        checks.append((distance <= criterion.within, expectation, distance_text))
    if criterion.reflected is not None:
        minimum, maximum = criterion.reflected
        is_reading_right = floor_share > 0 and minimum <= reading / floor_share <= maximum
        reading_problem = (
            Sentence("reading %(range)s %%", range=_format_range(minimum, maximum)),
            _add_floor_note(Sentence("reading %(percent).2f %%", percent=reading), floor_share),
        )
        checks.append((is_reading_right, *reading_problem))
    if criterion.rgb is not None:
        is_close = floor_share > 0 and all(
            abs(a / floor_share - b) <= criterion.rgb_tolerance for a, b in zip(rgb, criterion.rgb, strict=True)
        )
        actual_colour = ", ".join(str(int(part)) for part in rgb)
        colour = ", ".join(f"{part:g}" for part in criterion.rgb)
        expectation = Sentence("over the colour (%(colour)s)", colour=colour)
        colour_text = _add_floor_note(Sentence("over (%(colour)s)", colour=actual_colour), floor_share)
        checks.append((is_close, expectation, colour_text))
    if criterion.still:
        still_seconds = _measure_still_seconds(recording)
        expectation = Sentence("standing for %(seconds)g s", seconds=criterion.still)
        standing_text = Sentence("standing for %(seconds).2f s", seconds=still_seconds)
        checks.append((still_seconds >= criterion.still, expectation, standing_text))
    measures = (
        Measure(Sentence("end x"), recording.end.x, "mm"),
        Measure(Sentence("end y"), recording.end.y, "mm"),
        Measure(Sentence("sensor x"), position[0], "mm"),
        Measure(Sentence("sensor y"), position[1], "mm"),
        Measure(Sentence("reading"), reading, "%"),
        Measure(Sentence("time"), recording.end_t, "s"),
    )
    problem = next(((wanted, found) for holds, wanted, found in checks if not holds), None)
    if problem is None:
        template = (
            translatable("The robot stopped with its left sensor %(position)s, reading %(percent).2f %%.")
            if side == "left"
            else translatable("The robot stopped with its right sensor %(position)s, reading %(percent).2f %%.")
        )
        return pass_with(
            Sentence(template, position=position_text, percent=reading),
            recording.end_t,
            recording.end,
            measures,
        )
    template = (
        translatable("Expected the robot to stop with its left sensor %(expected)s, but the sensor was %(actual)s.")
        if side == "left"
        else translatable(
            "Expected the robot to stop with its right sensor %(expected)s, but the sensor was %(actual)s."
        )
    )
    return fail_with(
        Sentence(template, expected=problem[0], actual=problem[1]),
        recording.end_t,
        recording.end,
        Fraction(sum(holds for holds, _, _ in checks), len(checks)),
        measures,
        findings=(OtherReading(round(reading, 2)),) if problem == reading_problem else (),
    )


def _measure_still_seconds(recording: Recording) -> float:
    """Return the seconds before the end in which the robot neither drove nor turned."""
    moving_ticks = np.flatnonzero(~compute_still_mask(recording))
    ticks = len(recording.ticks)
    return tick_to_seconds(recording, ticks - 1 - int(moving_ticks[-1]) if len(moving_ticks) else ticks)


def _add_floor_note(description: str, floor_share: float) -> str:
    """Return what a sensor sees, with a note if only this fraction of it is floor."""
    if floor_share == 1:
        return description
    template = (
        translatable("%(description)s, partly beside the floor")
        if floor_share
        else translatable("%(description)s, beside the floor")
    )
    return Sentence(template, description=description)


def _format_range(minimum: float, maximum: float) -> str:
    if minimum == maximum:
        return f"{minimum:g}"
    return Sentence("%(least)s to %(most)s", least=f"{minimum:g}", most=f"{maximum:g}")
