"""Judging of the end of a run: whether the program ended by itself and in time, and where the robot was.

Faults of the responder don't end a program, so this module ignores them.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace
from types import MappingProxyType

import numpy as np

from service.grading.findings import ReportedFault
from service.grading.grade import Measure, TrialResult
from service.grading.judging.geometry import describe_area, measure_area_distance
from service.grading.judging.judge_declaration import declare_judge
from service.grading.judging.message_parts import describe_fault, quote_text
from service.grading.judging.outcome import Outcome, fail_with, find_ending_fault, pass_with
from service.language import translatable
from sim.recording import Fault, Recording, Verdict
from sim.recording_values import get_pose_at
from sim.sentences import Sentence
from submissions.criteria.ending import EndPose, Finishes, SinceEvent

_EVENTS: Mapping[str, str] = MappingProxyType(
    {
        "sent": translatable("%(text)s was sent"),
        "answered": translatable("%(text)s was answered"),
        "said": translatable("%(text)s was said"),
        "printed": translatable("%(text)s was printed"),
    }
)


@declare_judge(Finishes)
def judge_finishes(criterion: Finishes, trial: TrialResult) -> Outcome:
    """Judge how and when the program ended. Faults of the responder are ignored."""
    recording = trial.recording
    fault = find_ending_fault(recording)
    measures = (Measure(Sentence("time"), recording.end_t, "s"),)
    if fault is not None:
        message = Sentence(
            "Expected the program to end by itself, but %(end)s.", end=_describe_end(fault), fault=describe_fault(fault)
        )
        outcome = fail_with(message, fault.t, recording.end, measures=measures, findings=(ReportedFault(fault),))
        return replace(outcome, has_end_reason=True)
    if criterion.seconds is not None and recording.end_t > criterion.seconds + 1e-9:
        return fail_with(
            Sentence(
                "Expected the program to end within %(limit)g s, but it took %(seconds).2f s.",
                limit=criterion.seconds,
                seconds=recording.end_t,
            ),
            recording.end_t,
            recording.end,
            measures=measures,
        )
    message = Sentence("The program ended by itself after %(seconds).2f s.", seconds=recording.end_t)
    return pass_with(message, recording.end_t, recording.end, measures)


def _describe_end(fault: Fault) -> str:
    if fault.verdict is Verdict.TIME_LIMIT:
        return describe_fault(fault)
    return Sentence("after %(seconds).2f s: %(fault)s", seconds=fault.t, fault=describe_fault(fault))


@declare_judge(EndPose)
def judge_pose(criterion: EndPose, trial: TrialResult) -> Outcome:
    """Judge the end pose. Distances are in mm, angles in degrees modulo 360; the edges belong to a zone."""
    end, t = trial.recording.end, trial.recording.end_t
    pose_text = Sentence("(%(x).1f, %(y).1f) facing %(heading).1f°", x=end.x, y=end.y, heading=end.heading % 360)
    measures = (
        Measure(Sentence("end x"), end.x, "mm"),
        Measure(Sentence("end y"), end.y, "mm"),
        Measure(Sentence("end heading"), end.heading, "°"),
        Measure(Sentence("time"), t, "s"),
        *_measure_displacement(trial.recording),
    )
    if criterion.x is not None and criterion.y is not None:
        distance = math.hypot(end.x - criterion.x, end.y - criterion.y)
        if not distance <= criterion.tolerance:
            return fail_with(
                Sentence(
                    "Expected the robot to end within %(tolerance)g mm of (%(x)g, %(y)g), but it ended at %(pose)s, "
                    "%(distance).1f mm away.",
                    tolerance=criterion.tolerance,
                    x=criterion.x,
                    y=criterion.y,
                    pose=pose_text,
                    distance=distance,
                ),
                t,
                end,
                measures=measures,
            )
    if criterion.zone is not None:
        left, bottom, right, top = criterion.zone
        if not (left <= end.x <= right and bottom <= end.y <= top):
            return fail_with(
                Sentence(
                    "Expected the robot to end with x from %(left)g to %(right)g and y from %(bottom)g to %(top)g, "
                    "but it ended at %(pose)s.",
                    left=left,
                    right=right,
                    bottom=bottom,
                    top=top,
                    pose=pose_text,
                ),
                t,
                end,
                measures=measures,
            )
    if criterion.areas:
        gaps = [float(measure_area_distance(area, np.array([[end.x, end.y]]))[0]) for area in criterion.areas]
        if not min(gaps) <= 0:
            nearest_area = criterion.areas[gaps.index(min(gaps))]
            template = (
                translatable(
                    "Expected the robot to end in %(area)s, but it ended at %(pose)s, %(distance).0f mm outside."
                )
                if len(gaps) == 1
                else translatable(
                    "Expected the robot to end in one of %(count)s areas, the nearest being %(area)s, but it ended at "
                    "%(pose)s, %(distance).0f mm outside."
                )
            )
            return fail_with(
                Sentence(
                    template, count=len(gaps), area=describe_area(nearest_area), pose=pose_text, distance=min(gaps)
                ),
                t,
                end,
                measures=measures,
            )
    if criterion.heading is not None:
        heading_error = abs((end.heading - criterion.heading + 180) % 360 - 180)
        if not heading_error <= criterion.heading_tolerance:
            return fail_with(
                Sentence(
                    "Expected the robot to end facing %(heading)g° within %(tolerance)g°, but it ended at %(pose)s, "
                    "%(error).1f° off.",
                    heading=criterion.heading,
                    tolerance=criterion.heading_tolerance,
                    pose=pose_text,
                    error=heading_error,
                ),
                t,
                end,
                measures=measures,
            )
    if criterion.since is not None and (problem := _check_since(criterion.since, trial.recording)):
        return fail_with(problem, t, end, measures=measures)
    return pass_with(Sentence("The robot ended at %(pose)s.", pose=pose_text), t, end, measures)


def _check_since(event: SinceEvent, recording: Recording) -> str:
    """Return the problem with the distance or time since the event; empty if there is none."""
    event_time = next((t for t, text in _collect_texts(event, recording) if event.contains in text), None)
    event_text = Sentence(_EVENTS[event.of], text=quote_text(event.contains))
    if event_time is None:
        return Sentence("Expected that %(event)s, but it never was.", event=event_text)
    event_pose, end = get_pose_at(recording, event_time), recording.end
    distance = math.hypot(end.x - event_pose.x, end.y - event_pose.y)
    if event.moved is not None and not event.moved[0] <= distance <= event.moved[1]:
        return Sentence(
            "Expected the robot to end %(least)g to %(most)g mm from where it was when %(event)s, but it ended "
            "%(distance).1f mm away.",
            least=event.moved[0],
            most=event.moved[1],
            event=event_text,
            distance=distance,
        )
    seconds = recording.end_t - event_time
    if event.seconds is not None and not event.seconds[0] - 1e-9 <= seconds <= event.seconds[1] + 1e-9:
        return Sentence(
            "Expected the program to end %(least)g to %(most)g s after %(event)s, but it ended %(seconds).2f s after.",
            least=event.seconds[0],
            most=event.seconds[1],
            event=event_text,
            seconds=seconds,
        )
    return ""


def _collect_texts(event: SinceEvent, recording: Recording) -> list[tuple[float, str]]:
    """Return the times and texts of this kind, in order of time."""
    match event.of:
        case "sent":
            texts = [(each.t, each.text) for each in recording.messages if each.sender == "robot"]
        case "answered":
            answers = [each for each in recording.messages if each.sender == "responder"]
            texts = [(each.delivered, each.received) for each in answers if each.delivered is not None]
        case "said":
            texts = [(each.t, each.text) for each in recording.spoken]
        case "printed":
            texts = [(each.t, each.text) for each in recording.printed]
    return sorted(texts)


def _measure_displacement(recording: Recording) -> tuple[Measure, ...]:
    """Return the straight-line distance and direction from start to end."""
    dx, dy = recording.end.x - recording.start.x, recording.end.y - recording.start.y
    bearing = math.degrees(math.atan2(dy, dx))
    return Measure(Sentence("displacement"), math.hypot(dx, dy), "mm"), Measure(Sentence("bearing"), bearing, "°")
