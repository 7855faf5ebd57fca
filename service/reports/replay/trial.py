"""One trial as replay data: the robots tick by tick, and all events with their time and source line.

It hides nothing: the input is already the reader's view. ``docs/replay.md`` describes the keys.
"""

from __future__ import annotations

import base64
import math
from collections.abc import Callable, Sequence
from functools import partial
from operator import itemgetter
from typing import Any

import numpy as np
from numpy.typing import NDArray

from service.grading.grade import CriterionResult, Prediction, TrialResult
from service.language import ENGLISH, Language
from service.reports.display_text import abbreviate_message, format_decimal, to_display_text, to_one_line
from service.reports.faults import describe_place
from service.reports.messages import (
    PARTNER_OF,
    describe_loss_fully,
    describe_note,
    iterate_robots,
    select_answering_party,
)
from service.reports.replay.sources import Place, Sources
from service.reports.verdict_sentences import describe_verdict, format_trial_name
from sim.recording import COLUMNS, SECOND, AgentMessage, Image, Message, Pose, Recording, Ticks, Verdict
from sim.recording_values import collect_printed_lines, get_pose_at, get_recorded_robot
from sim.robot import LightSensor

#: Of each kind of event, in one trial.
_MAX_EVENTS = 2000
_MAX_IMAGES = 1000
_MAX_TEXT_LENGTH, _MAX_LINES = 600, 12
#: Steps in one unit of a column. A canvas shows nothing smaller.
_FINE_COLUMNS = frozenset({"x", "y", "heading"})
_STEPS_OF_FINE, _STEPS = 100, 10
#: The largest number of steps. A program can set the position of a wheel to any number.
_MAX_EXACT_STEPS = 2.0**52


def columns_to_json(ticks: Ticks) -> dict[str, dict[str, Any]]:
    """Return every column with known values, by its public name."""
    columns = {}
    for column in COLUMNS:
        values = np.asarray(getattr(ticks, column.display_attribute), np.float64).reshape(len(ticks), column.width)
        if len(ticks) and np.isfinite(values).any():
            steps_per_unit = _STEPS_OF_FINE if column.name in _FINE_COLUMNS else _STEPS
            columns[column.display_attribute] = {
                "unit": column.unit,
                "per": steps_per_unit,
                "added": [_encode_differences(part, steps_per_unit) for part in values.T],
            }
    return columns


def _encode_differences(values: NDArray[np.float64], steps_per_unit: int) -> list[int | None]:
    """Return the difference of each value from the previous one, the first from 0; None for missing values."""
    is_known = np.isfinite(values)
    clipped_values = np.clip(
        np.where(is_known, values, 0), -_MAX_EXACT_STEPS / steps_per_unit, _MAX_EXACT_STEPS / steps_per_unit
    )
    steps = np.rint(clipped_values * steps_per_unit).astype(np.int64)
    encoded_differences: list[int | None] = [None] * len(values)
    differences = np.diff(steps[is_known], prepend=0).tolist()
    for index, difference in zip(np.flatnonzero(is_known).tolist(), differences, strict=True):
        encoded_differences[index] = difference
    return encoded_differences


def trial_to_json(
    trial: TrialResult,
    sources: Sources,
    criteria: Sequence[CriterionResult] = (),
    index: int = 0,
    language: Language = ENGLISH,
) -> dict[str, Any]:
    """Return all data of a trial except its floor. ``index`` is its index in the evidence of the ``criteria``."""
    recording = trial.recording
    events, omitted_count = _collect_events(recording, sources, language)
    messages, omitted_messages = _collect_messages(recording, sources, language)
    predictions = [each for result in criteria for each in result.predictions if each.trial == index]
    return {
        "trial": index + 1,
        "name": format_trial_name(trial, language),
        "verdict": trial.verdict.value,
        "ended": describe_verdict(trial.verdict, language).short,
        "seconds": recording.end_t,
        "tick": recording.ticks.length / SECOND,
        "obstacles": recording.obstacles,
        "beacon": recording.beacon,
        "robots": [_robot_to_json(name, own, predictions) for name, own in iterate_robots(recording)],
        "messages": messages,
        "events": events,
        "left_out": omitted_count + omitted_messages,
        "lost": _collect_losses(recording, criteria, index),
    }


def compute_loss_time(recording: Recording, t: float | None) -> float:
    """Return the time at which a criterion was lost; the end of the trial if there is no time."""
    return recording.end_t if t is None or not math.isfinite(t) else max(0.0, min(t, recording.end_t))


def format_moment_link(trial: int, t: float) -> str:
    """Return a link to a moment of a trial, counted from 1. Rounding never makes it earlier."""
    return f"#trial={trial}&t={math.ceil(t * 1000 - 1e-6) / 1000:.3f}"


def _robot_to_json(name: str, recording: Recording, predictions: Sequence[Prediction]) -> dict[str, Any]:
    body = get_recorded_robot(recording)
    return {
        "name": name,
        "body": {
            "front": body.front,
            "back": body.back,
            "half_width": body.half_width,
            "wheel_spacing": body.wheel_spacing,
            "wheel_diameter": body.wheel_diameter,
            "ultrasonic": body.ultrasonic_y,
            "left": _sensor_to_json(body.left_light),
            "right": _sensor_to_json(body.right_light),
        },
        "start": _pose_to_json(recording.start),
        "end": _pose_to_json(recording.end),
        "columns": columns_to_json(recording.ticks),
        "pen": recording.pen,
        "images": [_image_to_json(image, predictions) for image in recording.images[:_MAX_IMAGES]],
    }


def _sensor_to_json(sensor: LightSensor) -> list[float]:
    return [sensor.x, sensor.y, sensor.diameter]


def _pose_to_json(pose: Pose) -> list[float]:
    return [round(value, 2) if math.isfinite(value) else 0.0 for value in (pose.x, pose.y, pose.heading)]


def _image_to_json(image: Image, predictions: Sequence[Prediction]) -> dict[str, Any]:
    data: dict[str, Any] = {
        "t": image.t,
        "side": image.side,
        "pose": _pose_to_json(image.pose),
        "left": _encode_pixels(image.left),
        "right": _encode_pixels(image.right),
    }
    for prediction in predictions:
        if (prediction.image.t, prediction.image.message) == (image.t, image.message):
            data["truth"] = to_one_line(prediction.truth, 60)
            data["answer"] = None if prediction.answer is None else to_one_line(prediction.answer, 60)
    return data


def _encode_pixels(rgba: bytes) -> str:
    """Return the pixels without their alpha values, which are all equal."""
    pixel_bytes = rgba[: len(rgba) // 4 * 4]
    return base64.b64encode(np.frombuffer(pixel_bytes, np.uint8).reshape(-1, 4)[:, :3].tobytes()).decode("ascii")


def _collect_events(recording: Recording, sources: Sources, language: Language) -> tuple[list[dict[str, Any]], int]:
    """Return prints, speech, touches and faults by time, and how many are left out."""
    events: list[dict[str, Any]] = []
    omitted_count = 0
    for robot, robot_recording in iterate_robots(recording):
        is_students, printed = robot_recording is recording, collect_printed_lines(robot_recording)
        event_groups: tuple[list[dict[str, Any]], ...] = (
            [
                _event_to_json(
                    line.t, robot, "printed", line.text, sources.find_writing_line(line.text) if is_students else None
                )
                for line in printed[:_MAX_EVENTS]
            ],
            [
                _event_to_json(
                    line.t,
                    robot,
                    "said",
                    line.text,
                    sources.find_writing_line(line.text, is_spoken=True) if is_students else None,
                )
                for line in robot_recording.spoken[:_MAX_EVENTS]
            ],
            [
                {**_event_to_json(touch.t, robot, "touched", touch.what), "pose": _pose_to_json(touch.pose)}
                for touch in robot_recording.touches[:_MAX_EVENTS]
            ],
            [
                _event_to_json(
                    fault.t,
                    fault.agent or fault.who,
                    "stopped" if fault.verdict is Verdict.TIME_LIMIT else "fault",
                    f"{fault.message} ({describe_place(fault, language)})" if fault.place else fault.message,
                    sources.find_fault_line(fault),
                )
                for fault in robot_recording.faults[:_MAX_EVENTS]
            ],
        )
        for entries, kind_events in zip(
            (printed, robot_recording.spoken, robot_recording.touches, robot_recording.faults),
            event_groups,
            strict=True,
        ):
            omitted_count += len(entries) - len(kind_events)
            events += kind_events
    return sorted(events, key=lambda event: event["t"]), omitted_count


def _event_to_json(t: float, party: str, kind: str, text: str, place: Place | None = None) -> dict[str, Any]:
    data = {
        "t": t,
        "who": to_one_line(party, 60),
        "kind": kind,
        "text": to_display_text(text, _MAX_TEXT_LENGTH, lines=_MAX_LINES),
    }
    return {**data, **_place_to_json(place)}


def _place_to_json(place: Place | None) -> dict[str, Any]:
    return {} if place is None else {"line": [place.source, place.line]}


def _collect_messages(recording: Recording, sources: Sources, language: Language) -> tuple[list[dict[str, Any]], int]:
    """Return the messages by time, with what the receiver got and when, and how many are left out."""
    builders: list[tuple[float, Callable[[], dict[str, Any]]]] = []
    for robot, robot_recording in iterate_robots(recording):
        responder = select_answering_party(robot_recording)
        other_party = PARTNER_OF[robot] if recording.partner is not None else responder
        writing_sources = sources if robot_recording is recording else None
        for message in robot_recording.messages:
            if message.sender == "partner":
                continue  # the other robot's list has it
            receiver = other_party if message.to_partner or recording.partner is None else responder
            parties = (robot, receiver) if message.sender == "robot" else (responder, robot)
            builders.append((message.t, partial(_message_to_json, message, *parties, writing_sources, language)))
    builders += [(each.t, partial(_agent_message_to_json, each, language)) for each in recording.agent_messages]
    # A trial can have a hundred thousand messages.
    builders.sort(key=itemgetter(0))
    return [build() for _, build in builders[:_MAX_EVENTS]], max(0, len(builders) - _MAX_EVENTS)


def _message_to_json(
    message: Message, sender: str, receiver: str, sources: Sources | None, language: Language
) -> dict[str, Any]:
    data: dict[str, Any] = {
        "t": message.t,
        "from": sender,
        "to": receiver,
        "text": abbreviate_message(message.text, _MAX_TEXT_LENGTH),
        "arrived": message.delivered,
    }
    if message.arrived_as is not None:
        data["arrived_as"] = abbreviate_message(message.arrived_as, _MAX_TEXT_LENGTH)
    loss_text = describe_loss_fully(message, language)
    if loss_text:
        data["befell"] = loss_text
    if message.sender == "robot" and sources is not None:
        data |= _place_to_json(sources.find_writing_line(message.text))
    return data


def _agent_message_to_json(message: AgentMessage, language: Language) -> dict[str, Any]:
    data = {
        "t": message.t,
        "from": to_one_line(message.sender, 60),
        "to": to_one_line(message.receiver, 60),
        "text": abbreviate_message(message.text, _MAX_TEXT_LENGTH),
        "arrived": None if message.note else message.t,
    }
    return {**data, "befell": describe_note(message.note, language)} if message.note else data


def _collect_losses(recording: Recording, criteria: Sequence[CriterionResult], index: int) -> list[dict[str, Any]]:
    """Return each criterion that the trial failed, with time and place."""
    losses = []
    for result in criteria:
        # An excused criterion has no marks to lose.
        for item in result.evidence if result.max_marks else ():
            if item.passed or item.trial != index:
                continue
            t = compute_loss_time(recording, item.t)
            losses.append(
                {
                    "t": t,
                    "pose": _pose_to_json(item.pose or get_pose_at(recording, t)),
                    "title": to_one_line(result.title, 120),
                    "text": to_display_text(item.message or result.message, _MAX_TEXT_LENGTH, lines=_MAX_LINES),
                    "marks": f"{format_decimal(result.marks)} / {format_decimal(result.max_marks)}",
                }
            )
    return losses
