"""Presents messages between two agents as a robot's questions and a responder's answers, for the same judges.

Nothing is judged here.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

from sim.recording import Message, Recording
from sim.sentences import Sentence
from submissions.criteria.agent_pairs import AgentPairCriterion

#: The note on an answer that is a JSON value instead of a text.
VALUE = "value"


@dataclass(frozen=True, slots=True)
class AgentPair:
    """The sender and receiver in words, and their messages presented as those of a robot and its responder.

    ``first_words`` is the receiver at the beginning of a sentence.
    """

    sender_name: str
    receiver_name: str
    first_words: str
    recording: Recording


def build_pair(criterion: AgentPairCriterion, recording: Recording) -> AgentPair:
    """Return the pair that a criterion checks: the robot and the responder, unless it names agents."""
    if not criterion.agents:
        names = (Sentence("the robot"), Sentence("the responder"), Sentence("The responder"))
        return AgentPair(*names, recording)
    sender, receiver = criterion.agents
    messages: list[Message] = []
    new_indices: dict[int, int] = {}
    for index, message in enumerate(recording.agent_messages):
        if (message.sender, message.receiver) == (sender, receiver):
            new_indices[index] = len(messages)
            messages.append(Message(message.t, "robot", message.text, message.t))
        elif message.reply_to in new_indices:
            note = "" if message.is_text else VALUE
            messages.append(
                Message(message.t, "responder", message.text, message.t, new_indices[message.reply_to], note)
            )
    faults = tuple(replace(fault, agent="") for fault in recording.faults if fault.agent == receiver)
    return AgentPair(
        Sentence("the %(agent)s", agent=sender),
        Sentence("the %(agent)s", agent=receiver),
        Sentence("The %(agent)s", agent=receiver),
        replace(recording, messages=tuple(messages), faults=faults),
    )
