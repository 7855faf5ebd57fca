"""Combination of two robots: the sender of each text, and all their messages without duplicates.

With one robot, this is that robot's recording.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from types import MappingProxyType

from service.language import ENGLISH, Language, translatable
from sim.recording import Message, Recording
from sim.recording_values import has_no_responder

#: The name of the second robot.
SECOND = "robot 2"
#: The receiver of each robot's messages without a responder.
PARTNER_OF: Mapping[str, str] = MappingProxyType({"robot": SECOND, SECOND: "robot"})

#: The name of the answering party without a responder.
SIMULATOR = "simulator"

#: Display names of the parties.
PARTY_NAMES: Mapping[str, str] = MappingProxyType(
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


def format_party_name(party: str, language: Language) -> str:
    """Return the display name of a party. Agents and other parties named by the student keep their names."""
    return language.say(PARTY_NAMES[party]) if party in PARTY_NAMES else party


def select_answering_party(recording: Recording) -> str:
    """Return the party that answers a robot that has no other robot to talk to."""
    return SIMULATOR if has_no_responder(recording) else "responder"


def iterate_robots(recording: Recording) -> Iterator[tuple[str, Recording]]:
    """Yield each robot's name and recording."""
    yield "robot", recording
    if recording.partner is not None:
        yield SECOND, recording.partner


def collect_messages(recording: Recording, language: Language = ENGLISH) -> list[tuple[str, Message]]:
    """Return every message with its sender, in order of sending."""
    messages = []
    for name, robot_recording in iterate_robots(recording):
        robot, responder = (
            format_party_name(name, language),
            format_party_name(select_answering_party(robot_recording), language),
        )
        if robot_recording is not recording and not has_no_responder(robot_recording):
            responder = language.say("responder to %(robot)s", robot=robot)
        for message in robot_recording.messages:
            if message.sender != "partner":  # the other robot's list has it
                messages.append((robot if message.sender == "robot" else responder, message))
    return messages if recording.partner is None else sorted(messages, key=lambda each: each[1].t)
