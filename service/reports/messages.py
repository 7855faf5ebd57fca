"""The messages of a trial for readers: who sends them, with one robot or two, and what the channel did to them.

Other modules judge who caused a loss.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from types import MappingProxyType

from service.language import ENGLISH, Language, translatable
from service.reports.display_text import abbreviate_message, to_one_line
from sim.recording import LossReason, Message, Recording
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


_REASONS: Mapping[LossReason, str] = MappingProxyType(
    {
        "chance": translatable("lost by chance"),
        "out of range": translatable("out of range"),
        "facing away": translatable("facing away"),
        "blocked": translatable("blocked"),
    }
)
#: The bridge's notes on messages.
_NOTES: Mapping[str, str] = MappingProxyType(
    {
        "duplicated": translatable("duplicated"),
        "lost": translatable("lost"),
        "malformed": translatable("malformed"),
        "no answer": translatable("no answer"),
        "undelivered": translatable("undelivered"),
    }
)


def describe_loss(message: Message, language: Language = ENGLISH) -> str:
    """Describe a message's loss or corruption in a few words; empty if it arrived once and unchanged."""
    note = describe_note(message.note, language)
    if message.arrived_as is not None:
        corruption = language.say("corrupted to %(text)s", text=abbreviate_message(message.arrived_as, 40))
        return f"{note}, {corruption}" if note else corruption
    return language.say(_REASONS[message.lost]) if message.lost else note


def describe_note(note: str, language: Language = ENGLISH) -> str:
    """Return the note on a message in words; empty if there is none."""
    return language.say(_NOTES[note]) if note in _NOTES else to_one_line(note, 40)


def describe_reach(message: Message, language: Language = ENGLISH) -> str:
    """Return how far away a message was lost, or how far the robot faced away; empty for other reasons."""
    if message.lost == "out of range" and message.distance is not None:
        return language.say("%(distance)s mm away", distance=math.ceil(message.distance))
    if message.lost == "facing away" and message.angle is not None:
        return language.say("%(angle)s° off", angle=math.ceil(abs(message.angle)))
    return ""


def describe_loss_fully(message: Message, language: Language = ENGLISH) -> str:
    """Describe the loss like ``describe_loss``, with the distance or angle."""
    return ", ".join(filter(None, (describe_loss(message, language), describe_reach(message, language))))
