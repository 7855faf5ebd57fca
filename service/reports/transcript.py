"""The transcript of a run: printed, spoken, answered and lost texts, in order. Nothing is escaped."""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType

from service.reports.messages import SIMULATOR, describe_loss_fully, iterate_robots, select_answering_party
from sim.recording import Recording
from sim.recording_values import collect_printed_lines

_ANSWER_LABELS: Mapping[str, str] = MappingProxyType({"responder": "answer", SIMULATOR: "answer of the simulator"})


def build_transcript(recording: Recording) -> list[tuple[float, str]]:
    """Return the simulated second and the line of each text, from all robots."""
    entries: list[tuple[float, int, str]] = []
    for robot, robot_recording in iterate_robots(recording):
        prefix = "" if robot_recording is recording else f"{robot}: "
        entries += [(line.t, 0, prefix + line.text) for line in collect_printed_lines(robot_recording)]
        entries += [(line.t, 1, f"{prefix}(says) {line.text}") for line in robot_recording.spoken]
        lost_messages = [
            message for message in robot_recording.messages if message.lost and message.sender != "partner"
        ]
        entries += [
            (message.t, 2, f"{prefix}(lost) {message.text}: {describe_loss_fully(message)}")
            for message in lost_messages
        ]
        arrival_labels = {"responder": _ANSWER_LABELS[select_answering_party(robot_recording)], "partner": "heard"}
        entries += [
            (message.delivered, 2, f"{prefix}({arrival_labels[message.sender]}) {message.received}")
            for message in robot_recording.messages
            if message.sender in arrival_labels and message.delivered is not None
        ]
    return [(t, text) for t, _, text in sorted(entries, key=lambda each: (each[0], each[1]))]
