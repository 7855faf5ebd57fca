"""Presents messages between two agents as a robot's questions and a responder's answers, for the same judges.

Nothing is judged here.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

from sim.recording import Message, Recording
from submissions.criteria.asking import BetweenAgents

#: The note on an answer that is a JSON value instead of a text.
VALUE = "value"


@dataclass(frozen=True, slots=True)
class Pair:
    """The sender and receiver in words, and their messages presented as those of a robot and its responder."""

    teller: str
    told: str
    recording: Recording


def pair_of(criterion: BetweenAgents, recording: Recording) -> Pair:
    """Return the pair that a criterion checks: the robot and the responder, unless it names agents."""
    if not criterion.agents:
        return Pair("the robot", "the responder", recording)
    teller, told = criterion.agents
    messages: list[Message] = []
    places: dict[int, int] = {}
    for index, each in enumerate(recording.agent_messages):
        if (each.sender, each.receiver) == (teller, told):
            places[index] = len(messages)
            messages.append(Message(each.t, "robot", each.text, each.t))
        elif each.reply_to in places:
            note = "" if each.is_text else VALUE
            messages.append(Message(each.t, "responder", each.text, each.t, places[each.reply_to], note))
    faults = tuple(replace(fault, agent="") for fault in recording.faults if fault.agent == told)
    return Pair(f"the {teller}", f"the {told}", replace(recording, messages=tuple(messages), faults=faults))
