"""Short descriptions of message losses and changes between robot and responder, for tables and arrows.

Other modules judge who caused them.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from types import MappingProxyType

from service.language import ENGLISH, Language, translatable
from service.reports.display_text import abbreviate_message, to_one_line
from sim.recording import LossReason, Message

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
