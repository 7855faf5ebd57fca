"""The criterion about what the responder answers.

How often images are named rightly is asked in ``classification.py``.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Literal, Self

from pydantic import Field, model_validator

from submissions.criteria.asking import BetweenAgents
from submissions.criteria.common import SomeTextOrTexts, SomeTexts, Texts
from submissions.criteria.texts import TextConditions


class Replies(BetweenAgents, TextConditions):
    """What the responder answers, arrived in time or not.

    ``expect`` maps a text of the robot's to its answer: each must have been sent, and answered so. An answer
    ``{ one_of = [...] }`` lists several right ones. ``in_order`` lists the answers to the messages that reached the
    responder, in the order of these messages: one answer for each, no more, no fewer.
    Otherwise every message of the robot's that reached the responder must have an answer that meets the
    conditions, and there must be ``at_least`` different ones of them (1); ``to`` and ``to_starts_with`` narrow down
    which messages are looked at. ``is_json`` asks for ``JSON::`` and well-formed JSON; with ``path`` the conditions,
    ``value`` and ``expect`` apply to what the JSON has there (``message.typ``), else to the whole answer.
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
        """True: nothing else is looked at."""
        return True

    @property
    def questions(self) -> Texts:
        """Those of ``expect``, unless it is agents that ask."""
        return () if self.agents else tuple(self.expect)

    @model_validator(mode="after")
    def _fits(self) -> Self:
        if self.value is not None and self.path is None:
            raise ValueError('has value without path, expected path = "message" or the like beside it')
        if self.expect and (self.to or self.to_starts_with or self.has_conditions or self.value is not None):
            raise ValueError("has expect beside other conditions, expected expect alone (with path and ignore_case)")
        if self.in_order and (self.expect or self.has_conditions or self.value is not None):
            raise ValueError(
                "has in_order beside other conditions, expected in_order alone (with path and ignore_case)"
            )
        right = [answer for each in self.expect.values() for answer in right_answers(each)]
        if self.path is None and not self.agents and any(not isinstance(answer, str) for answer in right):
            raise ValueError("has an answer in expect that is not a text, expected texts, or path beside them")
        return self


def right_answers(expected: object) -> Sequence[object]:
    """The answers that an entry of ``expect`` allows: what ``one_of`` lists, otherwise the entry itself."""
    if isinstance(expected, dict) and expected.keys() == {"one_of"} and isinstance(expected["one_of"], list):
        return expected["one_of"]
    return (expected,)
