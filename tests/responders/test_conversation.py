"""A conversation in simulated time: arrival order and times, without any process."""

from __future__ import annotations

from typing import Any

import pytest

from responders.channel import Cable, Channel
from responders.conversation import Answer, Conversation
from sim.recording import SECOND, TICK, Fault, Verdict
from sim.world import HashChain

pytestmark = pytest.mark.fast

DELAY = SECOND // 10


def conversation(**channel: Any) -> Conversation:
    return Conversation(Channel(**channel), 5, HashChain(), Cable())


def exchange(talk: Conversation, answer: Answer, now: int = 0) -> None:
    sent = talk.send("PY::x", now)
    for copy in range(sent.copies):
        talk.record_answer(sent, copy, answer)


def test_an_answer_arrives_after_the_delay_and_what_the_responder_slept() -> None:
    talk = conversation()
    exchange(talk, Answer("JSON::1", slept=SECOND, entry="1"))
    assert talk.deliver(SECOND + DELAY - 1) == []
    assert talk.deliver(SECOND + DELAY) == ["1"]
    assert talk.deliver(SECOND + DELAY + TICK) == []
    question, answered = talk.messages
    assert (question.t, question.delivered) == (0, 0)
    assert (answered.t, answered.delivered, answered.reply_to, answered.note) == (1.0, pytest.approx(1.1), 0, "")


def test_a_quick_answer_overtakes_a_slow_one() -> None:
    talk = conversation()
    exchange(talk, Answer("JSON::1", slept=SECOND, entry="1"))
    exchange(talk, Answer("JSON::2", entry="2"), now=TICK)
    assert talk.deliver(2 * SECOND) == ["2", "1"]


def test_a_plain_text_is_delivered_and_joins_no_queue() -> None:
    talk = conversation()
    exchange(talk, Answer("hello"))
    assert talk.deliver(SECOND) == []
    assert talk.messages[1].delivered == 1.0


def test_what_is_late_is_undelivered_and_stays_so() -> None:
    talk = conversation()
    exchange(talk, Answer("JSON::1", entry="1"))
    talk.finish()
    assert talk.messages[1].note == "undelivered"
    assert talk.deliver(SECOND) == []


def test_a_fault_is_kept_beside_the_answer_it_is_about() -> None:
    fault = Fault(0.0, Verdict.PROTOCOL_ERROR, "responder", "no JSON")
    talk = conversation()
    exchange(talk, Answer("JSON::{", fault=fault, note="malformed"))
    exchange(talk, Answer(fault=fault))
    assert talk.faults == [fault, fault]
    assert [message.note for message in talk.messages] == ["", "malformed", ""]


def test_copies_and_losses_are_the_channels() -> None:
    talk = conversation(duplication=1.0)
    exchange(talk, Answer("JSON::1", entry="1"))
    assert talk.deliver(SECOND) == ["1"] * 4
    assert [message.note for message in talk.messages] == ["duplicated", "", "duplicated", "", "duplicated"]
    lost = conversation(loss=1.0)
    exchange(lost, Answer("JSON::1", entry="1"))
    assert [(message.sender, message.note, message.delivered) for message in lost.messages] == [("robot", "lost", None)]


def test_the_chain_tells_deliveries_apart() -> None:
    hashes = set()
    for until in (0, SECOND):
        chain = HashChain()
        talk = Conversation(Channel(), 5, chain, Cable())
        exchange(talk, Answer("JSON::1", entry="1"))
        talk.deliver(until)
        hashes.add(chain.hexdigest())
    assert len(hashes) == 2


@pytest.mark.parametrize(
    ("channel", "digest"),
    [
        ({"loss": 0.4}, "8b2ff904a5a83a0c"),
        ({"loss": 0.2, "jitter": 0.4, "duplication": 0.4, "reordering": 0.3}, "c9831e6c34c9d0f4"),
    ],
)
def test_what_chance_does_over_a_cable_never_changes(channel: dict[str, Any], digest: str) -> None:
    """Otherwise, recordings made before the second kind of link would get other hashes."""
    chain = HashChain()
    talk = Conversation(Channel(**channel), 5, chain, Cable())
    for number in range(200):
        exchange(talk, Answer(f"JSON::{number}", entry=str(number)), number * SECOND // 4)
        talk.deliver((number + 1) * SECOND // 4)
    assert chain.hexdigest()[:16] == digest
