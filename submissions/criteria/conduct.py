"""Criterion about the protocol: whether robot and responder keep to its rules in all their messages."""

from __future__ import annotations

from typing import ClassVar, Literal

from pydantic import Field, model_validator

from responders.conduct import BreachKind
from submissions.criteria.common import Criterion, Texts
from submissions.strict_table import TableMistake


class Conduct(Criterion):
    """Robot and responder keep to the protocol, in at least ``at_least`` messages of the robot.

    ``allows`` lists the kinds of breaches that cost nothing.
    """

    check: Literal["conduct"]
    measures: ClassVar[Texts] = ("messages", "breaches")
    allows: tuple[Literal["malformed", "unanswered", "unasked", "spoofed", "flood"], ...] = ()
    at_least: int = Field(default=1, ge=1)

    @property
    def asks_responder(self) -> bool:
        """True: its answers are part of the protocol."""
        return True

    @property
    def forbidden_kinds(self) -> frozenset[BreachKind]:
        """The kinds of breaches that cost marks."""
        return frozenset(BreachKind) - {BreachKind(each) for each in self.allows}

    @model_validator(mode="after")
    def _check_forbids_anything(self) -> Conduct:
        if not self.forbidden_kinds:
            raise TableMistake("allows", "allows all breaches, expected fewer in allows")
        return self
