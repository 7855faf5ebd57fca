"""The transcript of a run: printed, spoken, answered and lost texts, in order. Nothing is escaped."""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType

from service.reports.message_losses import describe_loss_fully
from service.reports.robots import SIMULATOR, iterate_robots, select_answering_party
from sim.recording import Recording
from sim.recording_values import collect_printed_lines

_ANSWER_LABELS: Mapping[str, str] = MappingProxyType({"responder": "answer", SIMULATOR: "answer of the simulator"})


def build_transcript(recording: Recording) -> list[tuple[float, str]]:
    """Return the simulated second and the line of each text, from all robots."""
    shown: list[tuple[float, int, str]] = []
    for which, own in iterate_robots(recording):
        whose = "" if own is recording else f"{which}: "
        shown += [(line.t, 0, whose + line.text) for line in collect_printed_lines(own)]
        shown += [(line.t, 1, f"{whose}(says) {line.text}") for line in own.spoken]
        lost = [message for message in own.messages if message.lost and message.sender != "partner"]
        shown += [(message.t, 2, f"{whose}(lost) {message.text}: {describe_loss_fully(message)}") for message in lost]
        arrived = {"responder": _ANSWER_LABELS[select_answering_party(own)], "partner": "heard"}
        shown += [
            (message.delivered, 2, f"{whose}({arrived[message.sender]}) {message.received}")
            for message in own.messages
            if message.sender in arrived and message.delivered is not None
        ]
    return [(t, text) for t, _, text in sorted(shown, key=lambda each: (each[0], each[1]))]
