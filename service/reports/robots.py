"""Two robots told as one: who said a text, and all that they sent, each text once.

With one robot it is that robot's recording as it is.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from types import MappingProxyType

from service.language import ENGLISH, Language, translatable
from sim.recorded import without_responder
from sim.recording import Message, Recording

#: What the second robot is called.
SECOND = "robot 2"
#: Whom each robot talks to where there is no responder.
PARTNER_OF: Mapping[str, str] = MappingProxyType({"robot": SECOND, SECOND: "robot"})

#: Who answers where there is no responder.
SIMULATOR = "simulator"

#: What whoever takes part is called, or whose fault it was.
CALLED: Mapping[str, str] = MappingProxyType(
    {
        "robot": translatable("robot"),
        SECOND: translatable("robot 2"),
        "responder": translatable("responder"),
        SIMULATOR: translatable("simulator (no responder)"),
        "network": translatable("network"),
        "program": translatable("program"),
        "second program": translatable("second program"),
        "bridge": translatable("bridge"),
        "host": translatable("host"),
        "assignment": translatable("assignment"),
    }
)


def called(party: str, language: Language) -> str:
    """What whoever takes part is called; agents, and what else has a name in the student's own text, are called so."""
    return language.say(CALLED[party]) if party in CALLED else party


def answering(recording: Recording) -> str:
    """Who answers a robot that has no other robot to talk to."""
    return SIMULATOR if without_responder(recording) else "responder"


def robots_of(recording: Recording) -> Iterator[tuple[str, Recording]]:
    """What each robot is called, and its recording."""
    yield "robot", recording
    if recording.partner is not None:
        yield SECOND, recording.partner


def messages_of(recording: Recording, language: Language = ENGLISH) -> list[tuple[str, Message]]:
    """Every text with who said it, by the time at which it was sent."""
    said = []
    for name, own in robots_of(recording):
        robot, responder = called(name, language), called(answering(own), language)
        if own is not recording and not without_responder(own):
            responder = language.say("responder to %(robot)s", robot=robot)
        for message in own.messages:
            if message.sender != "partner":  # it is told as the other robot's
                said.append((robot if message.sender == "robot" else responder, message))
    return said if recording.partner is None else sorted(said, key=lambda each: each[1].t)
