"""Criteria about printed, spoken and sent texts.

Criteria about the responder's answers are in ``replies.py``.
"""

from __future__ import annotations

from typing import Annotated, Literal, Self

from pydantic import Field, field_validator, model_validator

from submissions.criteria.agent_pairs import AgentPairCriterion
from submissions.criteria.common import Criterion, CriterionWithStrays, NotBlank, SomeTextOrTexts, SomeTexts
from submissions.criteria.expressions import check_pattern
from submissions.strict_table import TableMistake


class TextConditions(Criterion):
    """Conditions on a text. A text counts if it meets all given conditions."""

    equals: SomeTextOrTexts = ()  # equals one of these
    starts_with: Annotated[SomeTextOrTexts, NotBlank] = ()  # begins with one of these
    contains: Annotated[SomeTextOrTexts, NotBlank] = ()  # contains all of these
    among: Annotated[SomeTextOrTexts, NotBlank] = ()  # contains one of these words and none of the others
    matches: str | None = None  # an RE2 regular expression that matches anywhere in the text
    ignore_case: bool = False

    @field_validator("matches")
    @classmethod
    def _check_matches(cls, value: str | None) -> str | None:
        return None if value is None else check_pattern(value)

    @property
    def has_conditions(self) -> bool:
        """Return whether any condition on a single text is given."""
        return bool(self.equals or self.starts_with or self.contains or self.among or self.matches is not None)


class TextSequence(TextConditions, CriterionWithStrays):
    """Number and order of the texts that count.

    Without a number, at least one text is required. With ``in_order``, the listed texts must occur in that order among
    those that count. Other texts may come between them unless ``only`` is set. ``compare`` selects the comparison.
    ``last`` uses the last text alone.
    """

    last: bool = False
    in_order: SomeTexts = ()
    only: bool = False
    compare: Literal["equals", "contains", "starts_with", "matches"] = "equals"
    at_least: int | None = Field(default=None, ge=0)
    at_most: int | None = Field(default=None, ge=0)
    exactly: int | None = Field(default=None, ge=0)

    @model_validator(mode="after")
    def _check_has_condition(self) -> Self:
        has_count = (self.at_least, self.at_most, self.exactly) != (None, None, None)
        if not (self.has_conditions or self.in_order or has_count or self._has_other_conditions()):
            raise ValueError(
                "has no condition, expected one of equals, contains, starts_with, matches, among, in_order, "
                "at_least, at_most, exactly"
            )
        if self.exactly is not None and (self.at_least is not None or self.at_most is not None):
            raise TableMistake("exactly", "has exactly beside at_least or at_most, expected one or the other")
        if self.at_least is not None and self.at_most is not None and self.at_least > self.at_most:
            raise TableMistake("at_least", "has an at_least above its at_most, expected at_least <= at_most")
        if self.in_order and (has_count or self.last):
            raise TableMistake(
                "in_order",
                "has in_order beside a count or last, "
                "expected in_order alone (with only = true if nothing else may come)",
            )
        if self.last and has_count:
            raise TableMistake("last", "has last beside a count, expected one or the other")
        if self.last and not self.has_conditions:
            raise TableMistake(
                "last",
                "has last without a condition, expected equals, contains, starts_with, matches or among beside it",
            )
        if self.only and not self.in_order:
            raise TableMistake("only", "has only without in_order, expected the texts in order")
        if self.compare == "matches":
            for pattern in self.in_order:
                try:
                    check_pattern(pattern)
                except ValueError as error:
                    raise TableMistake("in_order", f'has "{pattern}" in in_order, which {error}') from None
        return self

    def _has_other_conditions(self) -> bool:
        return False


class Prints(TextSequence):
    """The texts that the program prints, one text per print call.

    With ``of = "responder"``, the texts are the lines printed by the responder or by the cells of a notebook.
    """

    check: Literal["prints"]
    of: Literal["program", "responder"] = "program"

    @property
    def asks_responder(self) -> bool:
        """Return whether it uses the responder's output."""
        return self.of == "responder"


class Says(TextSequence):
    """The texts that the robot says."""

    check: Literal["says"]


class Messages(AgentPairCriterion, TextSequence):
    """The texts that the robot sends to the responder, such as ``PY::0``; images are sent as ``IMG_DATA::...``.

    With ``json = true``, the robot's queue counts instead: all valid answers that began with ``JSON::`` and arrived
    while the program ran, in order of arrival. ``path`` selects the part that is compared (``message.shape``; a number
    selects a list entry). With ``queue_grows = true``, each ``PY::`` message must add one entry to the queue, in the
    order of sending.
    """

    check: Literal["messages"]
    json_queue: bool = Field(default=False, alias="json")
    path: str | None = Field(default=None, min_length=1)
    queue_grows: bool = False

    @property
    def asks_responder(self) -> bool:
        """Return whether it uses the queue, which only answers fill."""
        return self.json_queue or self.queue_grows

    @model_validator(mode="after")
    def _check_path(self) -> Self:
        if self.path is not None and not self.json_queue:
            raise TableMistake("path", "has path without json, expected json = true beside it")
        return self

    def _has_other_conditions(self) -> bool:
        return self.queue_grows
