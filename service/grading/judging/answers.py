"""Access to the answers of a responder, or of an agent: the pair that talks, the JSON, and the value at a path.

Answers are student text, so nothing here raises, whatever they contain.
"""

from __future__ import annotations

import json
from bisect import bisect_left
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

from responders.message_format import JSON, parse_answer
from service.grading.judging.message_parts import describe_fault
from sim.recording import Fault, Message, Recording
from sim.sentences import Sentence
from submissions.criteria.agent_pairs import AgentPairCriterion


class MissingValue:
    """Type of NOTHING, which marks a missing value. It differs from JSON's null."""


MISSING = MissingValue()
#: The note on an answer that is a JSON value instead of a text.
VALUE = "value"


def is_json_answer(text: str) -> bool:
    """Return whether the text is ``JSON::`` followed by well-formed JSON."""
    return not isinstance(parse_json_answer(text), MissingValue)


def parse_json_answer(text: str) -> Any:
    """Return the value after ``JSON::``; NOTHING if the text has no such prefix or is malformed."""
    if not text.startswith(JSON):
        return MISSING
    try:
        return parse_answer(text)
    except ValueError:
        return MISSING


def find_at_path(value: Any, path: str) -> Any:
    """Return the value at a path such as ``message.shape``; NOTHING if there is none. Integers index lists."""
    for part in path.split("."):
        if isinstance(value, dict) and part in value:
            value = value[part]
        elif isinstance(value, list) and part.removeprefix("-").isdecimal() and part.isascii():
            index = int(part[:6])
            if not -len(value) <= index < len(value):
                return MISSING
            value = value[index]
        else:
            return MISSING
    return value


def as_text(value: Any) -> str:
    """Return a text unchanged, and other values as compact JSON."""
    if isinstance(value, str):
        return value
    try:
        return json.dumps(value, ensure_ascii=False, separators=(", ", ": "))
    except (ValueError, RecursionError):
        return "(nested too deeply)"


def is_same_value(actual: Any, expected: Any) -> bool:
    """Return whether two JSON values are equal. Numbers compare by value, booleans only with booleans."""
    if isinstance(actual, bool) or isinstance(expected, bool):
        return actual is expected
    if isinstance(actual, int | float) and isinstance(expected, int | float):
        try:
            return abs(actual - expected) <= 1e-9 * max(1.0, abs(expected))
        except OverflowError:  # an integer larger than any float
            return actual == expected
    if isinstance(actual, str) and isinstance(expected, str):
        return actual.split() == expected.split()
    if isinstance(actual, list) and isinstance(expected, list | tuple):
        return len(actual) == len(expected) and all(map(is_same_value, actual, expected))
    if isinstance(actual, dict) and isinstance(expected, dict):
        return actual.keys() == expected.keys() and all(is_same_value(actual[key], expected[key]) for key in expected)
    return actual is None and expected is None


class Answers:
    """The answers to each message of a recording, indexed because a run may contain 100 000 messages."""

    def __init__(self, recording: Recording) -> None:
        self._messages = recording.messages
        self._first: dict[int, Message] = {}
        self._all: dict[int, list[Message]] = {}
        for message in recording.messages:
            if message.sender == "responder" and message.reply_to is not None:
                self._all.setdefault(message.reply_to, []).append(message)
                if message.note != "duplicated":
                    self._first.setdefault(message.reply_to, message)
        self._faults = sorted((fault for fault in recording.faults if fault.who == "responder"), key=lambda f: f.t)

    def find_answer(self, index: int) -> Message | None:
        """Return the first answer to the message at ``index``, delivered or not, without copies made by the channel."""
        return self._first.get(index)

    def list_answers(self, index: int) -> Sequence[Message]:
        """Return every answer to the message at ``index``, including copies and lost ones, in the order given."""
        return self._all.get(index, ())

    def find_fault_after(self, index: int) -> Fault | None:
        """Return the responder's first fault since the message at ``index`` was sent, or None."""
        fault_index = bisect_left(self._faults, self._messages[index].t - 1e-9, key=lambda fault: fault.t)
        return self._faults[fault_index] if fault_index < len(self._faults) else None

    def describe_silence(self, index: int) -> str:
        """Return a sentence part that the message at ``index`` had no answer, with the reason if it is recorded."""
        fault = self.find_fault_after(index) or (self._faults[-1] if self._faults else None)
        if fault is None:
            return Sentence("there was no answer")
        return Sentence("there was no answer: %(fault)s", fault=describe_fault(fault))


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
