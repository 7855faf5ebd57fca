"""What is in a responder's answer: its JSON, and the part of it that a path picks.

Answers are students' texts: whatever they hold, nothing here raises.
"""

from __future__ import annotations

import json
from bisect import bisect_left
from collections.abc import Sequence
from typing import Any

from responders.message_format import JSON, parsed_answer
from service.grading.judging.message_parts import fault_words
from sim.recording import Fault, Message, Recording


class Nothing:
    """Stands for what is not there, which is not the same as JSON's null."""


NOTHING = Nothing()


def is_json_answer(text: str) -> bool:
    """Whether it is ``JSON::`` and well-formed JSON."""
    return not isinstance(parsed(text), Nothing)


def parsed(text: str) -> Any:
    """The object after ``JSON::``; NOTHING if the text has no such prefix or is malformed."""
    if not text.startswith(JSON):
        return NOTHING
    try:
        return parsed_answer(text)
    except ValueError:
        return NOTHING


def at_path(value: Any, path: str) -> Any:
    """What ``value`` has at ``message.shape``; whole numbers pick from lists. NOTHING if there is no such place."""
    for part in path.split("."):
        if isinstance(value, dict) and part in value:
            value = value[part]
        elif isinstance(value, list) and part.lstrip("-").isdecimal() and part.isascii():
            index = int(part[:6])
            if not -len(value) <= index < len(value):
                return NOTHING
            value = value[index]
        else:
            return NOTHING
    return value


def as_text(value: Any) -> str:
    """A text as it is, anything else as compact JSON."""
    if isinstance(value, str):
        return value
    try:
        return json.dumps(value, ensure_ascii=False, separators=(", ", ": "))
    except (ValueError, RecursionError):
        return "(nested too deeply)"


def same_value(found: Any, expected: Any) -> bool:
    """JSON equality: numbers by value, truth values only with truth values."""
    if isinstance(found, bool) or isinstance(expected, bool):
        return found is expected
    if isinstance(found, int | float) and isinstance(expected, int | float):
        try:
            return abs(found - expected) <= 1e-9 * max(1.0, abs(expected))
        except OverflowError:  # a whole number beyond all fractions
            return found == expected
    if isinstance(found, str) and isinstance(expected, str):
        return found.split() == expected.split()
    if isinstance(found, list) and isinstance(expected, list | tuple):
        return len(found) == len(expected) and all(map(same_value, found, expected))
    if isinstance(found, dict) and isinstance(expected, dict):
        return found.keys() == expected.keys() and all(same_value(found[key], expected[key]) for key in expected)
    return found is None and expected is None


class Answers:
    """What answered each message of one recording, looked up without a search: a run may hold 100 000 messages."""

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

    def to(self, index: int) -> Message | None:
        """The first answer to the message at ``index``, arrived or not; copies that the channel made do not count."""
        return self._first.get(index)

    def all_to(self, index: int) -> Sequence[Message]:
        """Every answer to the message at ``index``, copies and lost ones too, in the order in which they were given."""
        return self._all.get(index, ())

    def fault_after(self, index: int) -> Fault | None:
        """The first fault of the responder's from the moment on at which the message at ``index`` was sent."""
        place = bisect_left(self._faults, self._messages[index].t - 1e-9, key=lambda fault: fault.t)
        return self._faults[place] if place < len(self._faults) else None

    def silence(self, index: int) -> str:
        """That the message at ``index`` had no answer, and why, where the recording tells."""
        fault = self.fault_after(index) or (self._faults[-1] if self._faults else None)
        return "there was no answer" + (f": {fault_words(fault)}" if fault else "")
