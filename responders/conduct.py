"""Monitor of the protocol between a robot and its responder: which message broke which rule, and when.

It reads a recording and changes nothing. A criterion decides which breaches cost marks.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from enum import StrEnum
from types import MappingProxyType

from responders import message_format
from sim.recording import Message, Recording

#: More texts of the robot within one simulated second are a flood. The course's programs send at most 10.
FLOOD_TEXTS = 50
_FLOOD_SECONDS = 1.0


class BreachKind(StrEnum):
    """Kinds of breaches. ``docs/criteria.md`` explains them to instructors."""

    MALFORMED = "malformed"
    UNANSWERED = "unanswered"
    UNASKED = "unasked"
    SPOOFED = "spoofed"
    FLOOD = "flood"


class _State(StrEnum):
    """What the responder owes the robot about one text."""

    SILENT = "silent"
    ASKED = "asked"
    ANSWERED = "answered"


class _Event(StrEnum):
    """What happens to one text. Each copy that the channel makes of it may get an answer of its own."""

    TEXT = "a copy of the text reaches the responder"
    ANSWER = "the responder answers"
    END = "the trial ends"


#: The next state, or the breach, for each event in each state.
_TRANSITIONS: Mapping[tuple[_State, _Event], _State | BreachKind] = MappingProxyType(
    {
        (_State.SILENT, _Event.TEXT): _State.ASKED,
        (_State.SILENT, _Event.ANSWER): BreachKind.UNASKED,
        (_State.SILENT, _Event.END): _State.SILENT,
        (_State.ASKED, _Event.TEXT): _State.ASKED,
        (_State.ASKED, _Event.ANSWER): _State.ANSWERED,
        (_State.ASKED, _Event.END): BreachKind.UNANSWERED,
        (_State.ANSWERED, _Event.TEXT): _State.ASKED,
        (_State.ANSWERED, _Event.ANSWER): BreachKind.UNASKED,
        (_State.ANSWERED, _Event.END): _State.ANSWERED,
    }
)


@dataclass(frozen=True, slots=True)
class Breach:
    """A breach of the protocol at ``t`` seconds, by the text of a robot or responder."""

    kind: BreachKind
    t: float
    sender: str  # as in ``Message.sender``
    text: str


def find_breaches(recording: Recording) -> tuple[Breach, ...]:
    """Return all breaches of a trial in order of time."""
    breaches = [
        *_find_malformed_and_spoofed_texts(recording),
        *_follow_exchanges(recording.messages),
        *_find_floods(recording.messages),
    ]
    return tuple(sorted(breaches, key=lambda each: each.t))


def _find_malformed_and_spoofed_texts(recording: Recording) -> Iterator[Breach]:
    for message in recording.messages:
        content = message.text if message.sender == "responder" else message.text.removeprefix(message_format.PY)
        if content.startswith(message_format.JSON) and not _is_json(content):
            yield Breach(BreachKind.MALFORMED, message.t, message.sender, message.text)
        elif content.startswith((message_format.PY, message_format.IMG_DATA)) and not _is_image(message):
            yield Breach(BreachKind.SPOOFED, message.t, message.sender, message.text)
    for line in recording.printed:
        # The simulator writes the image itself. What a program writes after the prefix is an image that no sensor saw.
        if line.text.startswith(message_format.IMG_DATA) and line.text.removeprefix(message_format.IMG_DATA).strip(
            ": "
        ):
            yield Breach(BreachKind.SPOOFED, line.t, "robot", line.text)


def _is_json(text: str) -> bool:
    try:
        message_format.parse_answer(text)
    except ValueError:
        return False
    return True


def _is_image(message: Message) -> bool:
    return message.sender != "responder" and message.text.startswith(message_format.IMG_DATA)


def _follow_exchanges(messages: Sequence[Message]) -> Iterator[Breach]:
    """Yield the breaches of the declared transitions. Each text has a state of its own."""
    states: dict[int | None, _State] = {}
    for place, event, message in _list_events(messages):
        following = _TRANSITIONS[states.get(place, _State.SILENT), event]
        if isinstance(following, BreachKind):
            yield Breach(following, message.t, message.sender, message.text)
        else:
            states[place] = following


def _list_events(messages: Sequence[Message]) -> Iterator[tuple[int | None, _Event, Message]]:
    """Yield the events, each with the place of its text in the messages, which is None for an answer to no text.

    Texts to another robot need no answer, and an answer that the channel duplicated counts once.
    """
    places = []
    for place, message in enumerate(messages):
        if message.sender == "robot" and message.delivered is not None and not message.to_partner:
            places.append(place)
            yield place, _Event.TEXT, message
        elif message.sender == "responder" and message.note != "duplicated":
            text = None if message.reply_to is None else messages[message.reply_to]
            if text is not None and text.note == "duplicated":
                yield message.reply_to, _Event.TEXT, text
            yield message.reply_to, _Event.ANSWER, message
    for place in places:
        yield place, _Event.END, messages[place]


def _find_floods(messages: Sequence[Message]) -> Iterator[Breach]:
    """Yield a breach at the first text beyond the limit of each flood."""
    times = [message.t for message in messages if message.sender == "robot"]
    texts = [message.text for message in messages if message.sender == "robot"]
    flood_end = -1.0
    for place in range(FLOOD_TEXTS, len(times)):
        if times[place] - times[place - FLOOD_TEXTS] < _FLOOD_SECONDS and times[place] > flood_end:
            yield Breach(BreachKind.FLOOD, times[place], "robot", texts[place])
            flood_end = times[place] + _FLOOD_SECONDS
