"""What befell a message on its way between robot and responder, in the few words that a table or an arrow has room for.

Whose doing it was is judged elsewhere.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from types import MappingProxyType

from service.reports.readable import message_words, one_line
from sim.recording import LossReason, Message

_REASONS: Mapping[LossReason, str] = MappingProxyType(
    {"chance": "lost by chance", "out of range": "out of range", "facing away": "facing away", "blocked": "blocked"}
)


def befell(message: Message) -> str:
    """What befell a message on its way, in a few words; empty if it arrived once and as it was sent."""
    if message.arrived_as is not None:
        words = f"corrupted to {message_words(message.arrived_as, 40)}"
        return f"{message.note}, {words}" if message.note else words
    return _REASONS.get(message.lost, one_line(message.note, 40))


def out_of_reach_by(message: Message) -> str:
    """How far away a message was lost, or how much the robot faced away; empty if that is not why."""
    if message.lost == "out of range" and message.distance is not None:
        return f"{math.ceil(message.distance)} mm away"
    if message.lost == "facing away" and message.angle is not None:
        return f"{math.ceil(abs(message.angle))}° off"
    return ""


def befell_in_full(message: Message) -> str:
    """The same with how far out of reach it was."""
    return ", ".join(filter(None, (befell(message), out_of_reach_by(message))))
