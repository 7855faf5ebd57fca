"""The criterion ``conduct``: what costs marks, what is allowed, and what the message says."""

from __future__ import annotations

from typing import Any

import pytest

from judging import criterion, judged, recorded
from service.grading.grade import CriterionResult
from sim.recording import Message

pytestmark = pytest.mark.fast

QUESTION = Message(1.0, "robot", "PY::0", 1.0)
ANSWER = Message(1.1, "responder", "0", 1.1, 0)
BROKEN = Message(1.1, "responder", "JSON::{a", 1.1, 0, "malformed")


def judge(*messages: Message, **keys: Any) -> CriterionResult:
    return judged(criterion("conduct", **keys), recorded(messages=messages))


def test_keeping_to_the_protocol_has_full_marks() -> None:
    result = judge(QUESTION, ANSWER)
    assert (result.marks, result.message) == (4, "Robot and responder kept to the protocol (messages of the robot: 1).")


def test_a_breach_costs_marks_and_is_quoted_at_its_moment() -> None:
    result = judge(QUESTION, BROKEN)
    assert result.marks == 0
    assert 'but the responder answered "JSON::{a", which is not valid JSON (breaches: 1)' in result.message
    assert result.evidence[0].t == 1.1


def test_the_score_is_the_share_of_messages_without_a_breach() -> None:
    later = (Message(2.0, "robot", "PY::1", 2.0), Message(2.1, "responder", "1", 2.1, 2))
    assert judge(QUESTION, BROKEN, *later, over="mean").marks == 2


def test_allowed_breaches_cost_nothing() -> None:
    assert judge(QUESTION, allows=["unanswered"]).marks == 4
    assert judge(QUESTION, allows=["malformed"]).marks == 0


def test_a_silent_program_has_no_marks() -> None:
    result = judge()
    assert (result.marks, "1 or more messages, but it sent 0" in result.message) == (0, True)
