"""Presents messages between two agents as a robot's questions and a responder's answers, for the same judges.

Nothing is judged here.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

from sim.recording import Message, Recording
from submissions.criteria.agent_pairs import AgentPairCriterion

#: The note on an answer that is a JSON value instead of a text.
VALUE = "value"


@dataclass(frozen=True, slots=True)
class AgentPair:
    """The sender and receiver in words, and their messages presented as those of a robot and its responder."""

    sender_name: str
    receiver_name: str
    recording: Recording


def build_pair(criterion: AgentPairCriterion, recording: Recording) -> AgentPair:
    """Return the pair that a criterion checks: the robot and the responder, unless it names agents."""
    if not criterion.agents:
        return AgentPair("the robot", "the responder", recording)
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
    return AgentPair(f"the {teller}", f"the {told}", replace(recording, messages=tuple(messages), faults=faults))
