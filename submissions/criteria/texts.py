"""Criteria about what is printed, said and sent.

What the responder answers is asked in ``replies.py``.
"""

from __future__ import annotations

from typing import Annotated, Literal, Self

from pydantic import Field, field_validator, model_validator

from submissions.criteria.asking import BetweenAgents
from submissions.criteria.common import AmongMany, Criterion, NotBlank, SomeTextOrTexts, SomeTexts
from submissions.criteria.expressions import usable


class TextConditions(Criterion):
    """Which texts count. A text counts if every condition that is given holds for it."""

    equals: SomeTextOrTexts = ()  # the text is one of these
    starts_with: Annotated[SomeTextOrTexts, NotBlank] = ()  # begins with one of these
    contains: Annotated[SomeTextOrTexts, NotBlank] = ()  # has all of these in it
    among: Annotated[SomeTextOrTexts, NotBlank] = ()  # has one of these words in it, and no other of them
    matches: str | None = None  # a regular expression that RE2 takes, found anywhere in the text
    ignore_case: bool = False

    @field_validator("matches")
    @classmethod
    def _usable(cls, value: str | None) -> str | None:
        return None if value is None else usable(value)

    @property
    def has_conditions(self) -> bool:
        """Whether it asks anything of a single text."""
        return bool(self.equals or self.starts_with or self.contains or self.among or self.matches is not None)


class TextSequence(TextConditions, AmongMany):
    """How many texts must count, and in which order.

    Without a count at least one must; with ``in_order`` the listed texts must come in that order among
    those that count (others may lie between them unless ``only``), compared as ``compare`` says. ``last``
    looks at the last text alone.
    """

    last: bool = False
    in_order: SomeTexts = ()
    only: bool = False
    compare: Literal["equals", "contains", "starts_with", "matches"] = "equals"
    at_least: int | None = Field(default=None, ge=0)
    at_most: int | None = Field(default=None, ge=0)
    exactly: int | None = Field(default=None, ge=0)

    @model_validator(mode="after")
    def _asks_something(self) -> Self:
        counted = (self.at_least, self.at_most, self.exactly) != (None, None, None)
        if not (self.has_conditions or self.in_order or counted or self._asks_more()):
            raise ValueError(
                "asks for nothing, expected one of equals, contains, starts_with, matches, among, in_order, "
                "at_least, at_most, exactly"
            )
        if self.exactly is not None and (self.at_least is not None or self.at_most is not None):
            raise ValueError("has exactly beside at_least or at_most, expected one or the other")
        if self.at_least is not None and self.at_most is not None and self.at_least > self.at_most:
            raise ValueError("has an at_least above its at_most, expected at_least <= at_most")
        if self.in_order and (counted or self.last):
            raise ValueError(
                "has in_order beside a count or last, "
                "expected in_order alone (with only = true if nothing else may come)"
            )
        if self.last and counted:
            raise ValueError("has last beside a count, expected one or the other")
        if self.last and not self.has_conditions:
            raise ValueError(
                "has last without a condition, expected equals, contains, starts_with, matches or among beside it"
            )
        if self.only and not self.in_order:
            raise ValueError("has only without in_order, expected the texts in order")
        if self.compare == "matches":
            for pattern in self.in_order:
                try:
                    usable(pattern)
                except ValueError as error:
                    raise ValueError(f'has "{pattern}" in in_order, which {error}') from None
        return self

    def _asks_more(self) -> bool:
        return False


class Prints(TextSequence):
    """What the program prints, one text a print call.

    With ``of = "responder"`` it is what the responder prints, or the cells of a notebook: one text a line.
    """

    check: Literal["prints"]
    of: Literal["program", "responder"] = "program"

    @property
    def asks_responder(self) -> bool:
        """Whether it looks at what the responder prints."""
        return self.of == "responder"


class Says(TextSequence):
    """What the robot says."""

    check: Literal["says"]


class Messages(BetweenAgents, TextSequence):
    """What the robot sends to the responder: texts like ``PY::0``; an image is the text ``IMG_DATA::...``.

    With ``json = true`` it is, instead, the robot's queue that is looked at: every answer that began with
    ``JSON::``, was well formed and arrived while the program ran, in order of arrival; ``path`` picks the
    part that is compared (``message.shape``; a number picks from a list). ``queue_grows = true`` asks that
    each ``PY::`` message made the queue longer by one, in the order in which the messages were sent.
    """

    check: Literal["messages"]
    json_queue: bool = Field(default=False, alias="json")
    path: str | None = Field(default=None, min_length=1)
    queue_grows: bool = False

    @property
    def asks_responder(self) -> bool:
        """Whether it looks at the queue, which only answers fill."""
        return self.json_queue or self.queue_grows

    @model_validator(mode="after")
    def _path_needs_json(self) -> Self:
        if self.path is not None and not self.json_queue:
            raise ValueError("has path without json, expected json = true beside it")
        return self

    def _asks_more(self) -> bool:
        return self.queue_grows
