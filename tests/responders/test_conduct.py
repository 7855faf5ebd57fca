"""The monitor of the protocol: each kind of breach is named with its moment, and correct exchanges have none."""

from __future__ import annotations

from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from judging import recorded
from responders.conduct import FLOOD_TEXTS, BreachKind, find_breaches
from sim.recording import Message, TimedText

pytestmark = pytest.mark.fast


def ask(t: float, text: str = "PY::0", **more: Any) -> Message:
    return Message(t, "robot", text, **({"delivered": t} | more))


def answer(t: float, to: int | None, text: str = "0", **more: Any) -> Message:
    return Message(t, "responder", text, **({"delivered": t, "reply_to": to} | more))


def find(*messages: Message, printed: tuple[TimedText, ...] = ()) -> list[tuple[str, float]]:
    return [(each.kind.value, each.t) for each in find_breaches(recorded(messages=messages, printed=printed))]


@pytest.mark.parametrize(
    "messages",
    [
        (),
        (ask(1), answer(1.1, 0)),
        (ask(1, "IMG_DATA::{}"), answer(1.1, 0, 'JSON::{"a": 1}')),
        (ask(1), answer(1.1, 0, delivered=None, note="lost", lost="chance")),
        (ask(1, delivered=None, note="lost", lost="chance"),),
        (ask(1, note="duplicated"), answer(1.1, 0), answer(1.2, 0)),
        (ask(1), answer(1.1, 0), answer(1.1, 0, note="duplicated")),
        (ask(1, delivered=None, to_partner=True), Message(1.0, "partner", "PY::hi", 1.0)),
    ],
    ids=["silence", "an answer", "JSON", "answer lost", "text lost", "text twice", "answer twice", "two robots"],
)
def test_correct_exchanges_have_no_breach(messages: tuple[Message, ...]) -> None:
    assert find(*messages) == []


@pytest.mark.parametrize(
    ("messages", "breaches"),
    [
        ((ask(1), answer(1.1, 0, "JSON::{a: 1}", note="malformed")), [("malformed", 1.1)]),
        ((ask(1, "PY::JSON::{"), answer(1.1, 0)), [("malformed", 1.0)]),
        ((ask(1), ask(2), answer(2.1, 1)), [("unanswered", 1.0)]),
        ((ask(1), answer(1.1, 0), answer(1.2, 0)), [("unasked", 1.2)]),
        ((answer(1.1, None),), [("unasked", 1.1)]),
        ((ask(1), answer(1.1, 0, "PY::0")), [("spoofed", 1.1)]),
        ((ask(1, "PY::IMG_DATA::{}"), answer(1.1, 0)), [("spoofed", 1.0)]),
    ],
    ids=[
        "answer",
        "text",
        "unanswered",
        "second answer",
        "answer to nothing",
        "answer like a text",
        "text like an image",
    ],
)
def test_each_breach_is_named_with_its_moment(messages: tuple[Message, ...], breaches: list[tuple[str, float]]) -> None:
    assert find(*messages) == breaches


def test_an_image_that_the_program_writes_itself_is_spoofed() -> None:
    lines = (TimedText(1.0, "IMG_DATA"), TimedText(2.0, 'IMG_DATA::{"left":"0","right":"0"}'))
    assert find(printed=lines) == [("spoofed", 2.0)]


@pytest.mark.parametrize(("count", "floods"), [(FLOOD_TEXTS, 0), (FLOOD_TEXTS + 1, 1), (3 * FLOOD_TEXTS, 1)])
def test_a_flood_is_named_once(count: int, floods: int) -> None:
    messages = [each for number in range(count) for each in (ask(number / 1000), answer(number / 1000, 2 * number))]
    assert [kind for kind, _ in find(*messages)] == ["flood"] * floods


@given(st.lists(st.sampled_from(["once", "twice", "never"]), max_size=20))
def test_each_text_that_is_not_answered_once_is_one_breach(answers: list[str]) -> None:
    messages: list[Message] = []
    for number, how in enumerate(answers):
        place = len(messages)
        messages.append(ask(number))
        messages += [answer(number + 0.1, place)] * {"once": 1, "twice": 2, "never": 0}[how]
    kinds = [kind for kind, _ in find(*messages)]
    assert kinds.count(BreachKind.UNANSWERED) == answers.count("never")
    assert kinds.count(BreachKind.UNASKED) == answers.count("twice")
    assert len(kinds) == len(answers) - answers.count("once")
