"""What befell a message on its way between robot and responder, in the few words that a table or an arrow has room for.

Whose doing it was is judged elsewhere.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from types import MappingProxyType

from service.language import ENGLISH, Language, translatable
from service.reports.readable import message_words, one_line
from sim.recording import LossReason, Message

_REASONS: Mapping[LossReason, str] = MappingProxyType(
    {
        "chance": translatable("lost by chance"),
        "out of range": translatable("out of range"),
        "facing away": translatable("facing away"),
        "blocked": translatable("blocked"),
    }
)
#: What the bridge notes of a message.
_NOTES: Mapping[str, str] = MappingProxyType(
    {
        "duplicated": translatable("duplicated"),
        "lost": translatable("lost"),
        "malformed": translatable("malformed"),
        "no answer": translatable("no answer"),
        "undelivered": translatable("undelivered"),
    }
)


def befell(message: Message, language: Language = ENGLISH) -> str:
    """What befell a message on its way, in a few words; empty if it arrived once and as it was sent."""
    note = note_words(message.note, language)
    if message.arrived_as is not None:
        words = language.say("corrupted to %(text)s", text=message_words(message.arrived_as, 40))
        return f"{note}, {words}" if note else words
    return language.say(_REASONS[message.lost]) if message.lost else note


def note_words(note: str, language: Language = ENGLISH) -> str:
    """What was noted of a message; empty if nothing was."""
    return language.say(_NOTES[note]) if note in _NOTES else one_line(note, 40)


def out_of_reach_by(message: Message, language: Language = ENGLISH) -> str:
    """How far away a message was lost, or how much the robot faced away; empty if that is not why."""
    if message.lost == "out of range" and message.distance is not None:
        return language.say("%(distance)s mm away", distance=math.ceil(message.distance))
    if message.lost == "facing away" and message.angle is not None:
        return language.say("%(angle)s° off", angle=math.ceil(abs(message.angle)))
    return ""


def befell_in_full(message: Message, language: Language = ENGLISH) -> str:
    """The same with how far out of reach it was."""
    return ", ".join(filter(None, (befell(message, language), out_of_reach_by(message, language))))
