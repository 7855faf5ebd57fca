"""Two robots told as one: who said a text, and all that they sent, each text once.

With one robot it is that robot's recording as it is.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from types import MappingProxyType

from sim.recording import Message, Recording

#: What the second robot is called.
SECOND = "robot 2"
#: Whom each robot talks to where there is no responder.
PARTNER_OF: Mapping[str, str] = MappingProxyType({"robot": SECOND, SECOND: "robot"})


def robots_of(recording: Recording) -> Iterator[tuple[str, Recording]]:
    """What each robot is called, and its recording."""
    yield "robot", recording
    if recording.partner is not None:
        yield SECOND, recording.partner


def messages_of(recording: Recording) -> list[tuple[str, Message]]:
    """Every text with who said it, by the time at which it was sent."""
    said = []
    for robot, own in robots_of(recording):
        responder = "responder" if own is recording else f"responder to {robot}"
        for message in own.messages:
            if message.sender != "partner":  # it is told as the other robot's
                said.append((robot if message.sender == "robot" else responder, message))
    return said if recording.partner is None else sorted(said, key=lambda each: each[1].t)
