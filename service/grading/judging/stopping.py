"""Judging of what is under a light sensor when the robot stops.

A run ends at the last tick that was reached. Motors left on don't move the robot after its program has ended.
"""

from __future__ import annotations

import math
from dataclasses import replace
from fractions import Fraction
from typing import Literal

import numpy as np

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
        wanted, end_t = _describe_expected(criterion), recording.end_t
        message = f"Expected the robot to stop {wanted}, but its program was still running after {end_t:.2f} s."
        return replace(fail_with(message, end_t, recording.end), has_end_reason=fault.verdict is Verdict.TIME_LIMIT)
    if not len(recording.ticks):
        return fail_with(
            f"Expected the robot to stop {_describe_expected(criterion)}, but it never moved: no time passed."
        )
    sides: tuple[Side, ...] = ("left", "right") if criterion.sensor == "either" else (criterion.sensor,)
    tried = [_judge_side(criterion, side, recording) for side in sides]
    return max(tried, key=lambda outcome: outcome.score)


def _judge_side(criterion: StopOn, side: Side, recording: Recording) -> Outcome:
    place = locate_part(recording, side, recording.end)
    rgb = (recording.ticks.left_rgb if side == "left" else recording.ticks.right_rgb)[-1]
    reflected = 100 * int(rgb[0]) / 255
    checks: list[tuple[bool, str, str]] = []  # whether it holds, the expected value, the actual value
    where = f"at ({place[0]:.1f}, {place[1]:.1f})"
    # Everything off the floor is black, so the reading covers only the floor.
    floor = 1.0 if criterion.off_floor else measure_floor_share(recording, side, recording.end)
    beside = "" if floor == 1 else ", partly beside the floor" if floor else ", beside the floor"
    if criterion.zone is not None:
        checks.append((is_in_zone(place, criterion.zone), f"at {describe_zone(criterion.zone)}", where))
    if criterion.near is not None:
        away = math.dist(place, criterion.near)
        x, y = criterion.near
        wanted = f"within {criterion.within:g} mm of ({x:g}, {y:g})"
        checks.append((away <= criterion.within, wanted, f"{where}, {away:.1f} mm away"))
    if criterion.reflected is not None:
        least, most = criterion.reflected
        reads = floor > 0 and least <= reflected / floor <= most
        checks.append((reads, f"reading {_format_range(least, most)} %", f"reading {reflected:.2f} %{beside}"))
    if criterion.rgb is not None:
        close = floor > 0 and all(
            abs(a / floor - b) <= criterion.rgb_tolerance for a, b in zip(rgb, criterion.rgb, strict=True)
        )
        seen = ", ".join(str(int(part)) for part in rgb)
        colour = ", ".join(f"{part:g}" for part in criterion.rgb)
        checks.append((close, f"over the colour ({colour})", f"over ({seen}){beside}"))
    if criterion.still:
        stood = _measure_still_seconds(recording)
        checks.append((stood >= criterion.still, f"standing for {criterion.still:g} s", f"standing for {stood:.2f} s"))
    measures = (
        Measure("end x", recording.end.x, "mm"),
        Measure("end y", recording.end.y, "mm"),
        Measure("sensor x", place[0], "mm"),
        Measure("sensor y", place[1], "mm"),
        Measure("reading", reflected, "%"),
        Measure("time", recording.end_t, "s"),
    )
    wrong = next(((wanted, found) for holds, wanted, found in checks if not holds), None)
    if wrong is None:
        return pass_with(
            f"The robot stopped with its {side} sensor {where}, reading {reflected:.2f} %.",
            recording.end_t,
            recording.end,
            measures,
        )
    return fail_with(
        f"Expected the robot to stop with its {side} sensor {wrong[0]}, but the sensor was {wrong[1]}.",
        recording.end_t,
        recording.end,
        Fraction(sum(holds for holds, _, _ in checks), len(checks)),
        measures,
    )


def _measure_still_seconds(recording: Recording) -> float:
    """Return the seconds before the end in which the robot neither drove nor turned."""
    moved = np.flatnonzero(~compute_still_mask(recording))
    ticks = len(recording.ticks)
    return tick_to_seconds(recording, ticks - 1 - int(moved[-1]) if len(moved) else ticks)


def _describe_expected(criterion: StopOn) -> str:
    return (
        "with one of its light sensors in place"
        if criterion.sensor == "either"
        else (f"with its {criterion.sensor} light sensor in place")
    )


def _format_range(least: float, most: float) -> str:
    return f"{least:g}" if least == most else f"{least:g} to {most:g}"
