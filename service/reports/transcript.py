"""The transcript of a run: printed, spoken, answered and lost texts, in order. Nothing is escaped."""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType

from service.reports.crossing import befell_in_full
from service.reports.robots import SIMULATOR, answering, robots_of
from sim.recorded import printed_alone
from sim.recording import Recording

_ANSWERED: Mapping[str, str] = MappingProxyType({"responder": "answer", SIMULATOR: "answer of the simulator"})


def transcript(recording: Recording) -> list[tuple[float, str]]:
    """Return the simulated second and the line of each text, from all robots."""
    shown: list[tuple[float, int, str]] = []
    for which, own in robots_of(recording):
        whose = "" if own is recording else f"{which}: "
        shown += [(line.t, 0, whose + line.text) for line in printed_alone(own)]
        shown += [(line.t, 1, f"{whose}(says) {line.text}") for line in own.spoken]
        lost = [message for message in own.messages if message.lost and message.sender != "partner"]
        shown += [(message.t, 2, f"{whose}(lost) {message.text}: {befell_in_full(message)}") for message in lost]
        arrived = {"responder": _ANSWERED[answering(own)], "partner": "heard"}
        shown += [
            (message.delivered, 2, f"{whose}({arrived[message.sender]}) {message.received}")
            for message in own.messages
            if message.sender in arrived and message.delivered is not None
        ]
    return [(t, text) for t, _, text in sorted(shown, key=lambda each: (each[0], each[1]))]
