"""Criterion about the responder's answers.

Criteria about the accuracy of image classification are in ``classification.py``.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Literal, Self

from pydantic import Field, model_validator

from submissions.criteria.agent_pairs import AgentPairCriterion
from submissions.criteria.common import SomeTextOrTexts, SomeTexts, Texts
from submissions.criteria.texts import TextConditions
from submissions.strict_table import TableMistake


class Replies(AgentPairCriterion, TextConditions):
    """The responder's answers, whether or not they arrived in time.

    ``expect`` maps a text of the robot to its answer. Each text must have been sent and answered as given. An answer
    ``{ one_of = [...] }`` lists alternatives. ``in_order`` lists the exact answers to the messages that reached the
    responder, in the order of these messages.

    Otherwise, every robot message that reached the responder must have an answer that meets the conditions, and there
    must be ``at_least`` (default 1) different messages. ``to`` and ``to_starts_with`` select the messages. ``is_json``
    requires ``JSON::`` and valid JSON. With ``path``, the conditions, ``value`` and ``expect`` apply to that place in
    the JSON (``message.typ``), otherwise to the whole answer.
    """

    check: Literal["replies"]
    to: SomeTextOrTexts = ()
    to_starts_with: SomeTextOrTexts = ()
    expect: dict[str, Any] = Field(default_factory=dict)
    at_least: int = Field(default=1, ge=0)
    is_json: bool = False
    path: str | None = Field(default=None, min_length=1)
    value: Any = None
    in_order: SomeTexts = ()

    @property
    def asks_responder(self) -> bool:
        """True: only answers count."""
        return True

    @property
    def questions(self) -> Texts:
        """The texts of ``expect``; empty if agents ask."""
        return () if self.agents else tuple(self.expect)

    @model_validator(mode="after")
    def _check_options(self) -> Self:
        if self.value is not None and self.path is None:
            raise TableMistake("value", 'has value without path, expected path = "message" or the like beside it')
        if self.expect and (self.to or self.to_starts_with or self.has_conditions or self.value is not None):
            raise TableMistake(
                "expect", "has expect beside other conditions, expected expect alone (with path and ignore_case)"
            )
        if self.in_order and (self.expect or self.has_conditions or self.value is not None):
            raise TableMistake(
                "in_order", "has in_order beside other conditions, expected in_order alone (with path and ignore_case)"
            )
        allowed_answers = [answer for each in self.expect.values() for answer in list_allowed_answers(each)]
        if self.path is None and not self.agents and any(not isinstance(answer, str) for answer in allowed_answers):
            raise TableMistake(
                "expect", "has an answer in expect that is not a text, expected texts, or path beside them"
            )
        return self


def list_allowed_answers(expected: object) -> Sequence[object]:
    """Return the answers that an entry of ``expect`` allows: the list in ``one_of``, or the entry itself."""
    if isinstance(expected, dict) and expected.keys() == {"one_of"} and isinstance(expected["one_of"], list):
        return expected["one_of"]
    return (expected,)
