"""Judging of what is under a light sensor when the robot stops.

A run ends at the last tick that was reached. Motors left on don't move the robot after its program has ended.
"""

from __future__ import annotations

import math
from dataclasses import replace
from fractions import Fraction
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
from sim.recording import Recording, Verdict
from sim.recording_values import tick_to_seconds
from submissions.criteria.stopping import StopOn

Side = Literal["left", "right"]


@declare_judge(StopOn)
def judge_stop_on(criterion: StopOn, trial: TrialResult) -> Outcome:
    """Judge the light sensor's view where the robot stopped. Of two sensors, the better one counts."""
    recording = trial.recording
    fault = find_ending_fault(recording)
    if fault is not None and fault.verdict is not Verdict.PROGRAM_ERROR:
        expectation, end_t = _describe_expected(criterion), recording.end_t
        message = f"Expected the robot to stop {expectation}, but its program was still running after {end_t:.2f} s."
        outcome = fail_with(message, end_t, recording.end, findings=(StillRunning(),))
        return replace(outcome, has_end_reason=fault.verdict is Verdict.TIME_LIMIT)
    if not len(recording.ticks):
        return fail_with(
            f"Expected the robot to stop {_describe_expected(criterion)}, but it never moved: no time passed."
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
    position_text = f"at ({position[0]:.1f}, {position[1]:.1f})"
    # Everything off the floor is black, so the reading covers only the floor.
    floor_share = 1.0 if criterion.off_floor else measure_floor_share(recording, side, recording.end)
    floor_note = "" if floor_share == 1 else ", partly beside the floor" if floor_share else ", beside the floor"
    if criterion.zone is not None:
        checks.append((is_in_zone(position, criterion.zone), f"at {describe_zone(criterion.zone)}", position_text))
    if criterion.near is not None:
        distance = math.dist(position, criterion.near)
        x, y = criterion.near
        expectation = f"within {criterion.within:g} mm of ({x:g}, {y:g})"
        checks.append((distance <= criterion.within, expectation, f"{position_text}, {distance:.1f} mm away"))
    if criterion.reflected is not None:
        minimum, maximum = criterion.reflected
        is_reading_right = floor_share > 0 and minimum <= reading / floor_share <= maximum
        reading_problem = f"reading {_format_range(minimum, maximum)} %", f"reading {reading:.2f} %{floor_note}"
        checks.append((is_reading_right, *reading_problem))
    if criterion.rgb is not None:
        is_close = floor_share > 0 and all(
            abs(a / floor_share - b) <= criterion.rgb_tolerance for a, b in zip(rgb, criterion.rgb, strict=True)
        )
        actual_colour = ", ".join(str(int(part)) for part in rgb)
        colour = ", ".join(f"{part:g}" for part in criterion.rgb)
        checks.append((is_close, f"over the colour ({colour})", f"over ({actual_colour}){floor_note}"))
    if criterion.still:
        still_seconds = _measure_still_seconds(recording)
        checks.append(
            (
                still_seconds >= criterion.still,
                f"standing for {criterion.still:g} s",
                f"standing for {still_seconds:.2f} s",
            )
        )
    measures = (
        Measure("end x", recording.end.x, "mm"),
        Measure("end y", recording.end.y, "mm"),
        Measure("sensor x", position[0], "mm"),
        Measure("sensor y", position[1], "mm"),
        Measure("reading", reading, "%"),
        Measure("time", recording.end_t, "s"),
    )
    problem = next(((wanted, found) for holds, wanted, found in checks if not holds), None)
    if problem is None:
        return pass_with(
            f"The robot stopped with its {side} sensor {position_text}, reading {reading:.2f} %.",
            recording.end_t,
            recording.end,
            measures,
        )
    return fail_with(
        f"Expected the robot to stop with its {side} sensor {problem[0]}, but the sensor was {problem[1]}.",
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


def _describe_expected(criterion: StopOn) -> str:
    return (
        "with one of its light sensors in place"
        if criterion.sensor == "either"
        else (f"with its {criterion.sensor} light sensor in place")
    )


def _format_range(minimum: float, maximum: float) -> str:
    return f"{minimum:g}" if minimum == maximum else f"{minimum:g} to {maximum:g}"
