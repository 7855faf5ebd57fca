"""Shows what two agents said to each other as if the robot had asked a responder, so that it is judged alike.

Nothing is judged here.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

from sim.recording import Message, Recording
from submissions.criteria.asking import BetweenAgents


@dataclass(frozen=True, slots=True)
class Pair:
    """Who asks and who answers, in words, and their messages as those of a robot and its responder."""

    asker: str
    asked: str
    recording: Recording


def pair_of(criterion: BetweenAgents, recording: Recording) -> Pair:
    """The two whom a criterion looks at: the robot and the responder, unless it names others."""
    if not criterion.agents:
        return Pair("the robot", "the responder", recording)
    asker, asked = criterion.agents
    messages: list[Message] = []
    places: dict[int, int] = {}
    for index, each in enumerate(recording.agent_messages):
        if (each.sender, each.receiver) == (asker, asked):
            places[index] = len(messages)
            messages.append(Message(each.t, "robot", each.text, each.t))
        elif each.reply_to in places:
            messages.append(Message(each.t, "responder", each.text, each.t, places[each.reply_to]))
    faults = tuple(replace(fault, agent="") for fault in recording.faults if fault.agent == asked)
    return Pair(f"the {asker}", f"the {asked}", replace(recording, messages=tuple(messages), faults=faults))
