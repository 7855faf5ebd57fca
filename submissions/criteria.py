"""What can be marked without code: one schema for each kind of criterion, told apart by ``check``.

Judging is the service's (``service/grading``); this only says what is asked, and refuses what cannot be
asked.

Every criterion is judged once a trial. A trial passes or fails, and has a score between 0 and 1: the part
of what was asked that was reached (3 of 5 lines in order, 2 of 3 messages answered), 1 exactly when it
passes. ``over`` turns the trials into marks: ``share`` is the share of trials that pass, ``all`` is
everything or nothing, ``mean``, ``median`` and ``worst`` are taken over the scores. Marks are rounded half
up, once, to two places.

Texts are compared without regard to spaces at the ends and to the length of runs of spaces.
"""

from __future__ import annotations

import re
from decimal import Decimal
from typing import Annotated, Any, Literal, Self

from pydantic import BaseModel, ConfigDict, Field, ValidationInfo, field_validator, model_validator

#: Longest text of a student's that a pattern is tried on; a pattern that backtracks must not hold a worker.
LONGEST_MATCHED_TEXT = 1000

Texts = tuple[str, ...]


def _one_or_many(value: object) -> object:
    """A single text stands for a list of one."""
    if isinstance(value, str):
        return (value,)
    return tuple(value) if isinstance(value, list) else value


def _not_blank(value: Texts) -> Texts:
    """Refuses a text that is part of every text."""
    if not all(text.strip() for text in value):
        raise ValueError("has an empty text in it, which every text contains, expected something to look for")
    return value


class _Criterion(BaseModel):
    """What every criterion has. ``scenarios`` names those it looks at; all, if empty."""

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)

    id: str = Field(default="", pattern=r"^[a-z0-9][a-z0-9_-]*$|^$", max_length=80)  # from the title, if not given
    title: str = Field(min_length=1, max_length=200)
    marks: Decimal = Field(ge=0, le=10000, decimal_places=2)
    scenarios: tuple[str, ...] = ()
    #: how the trials become marks
    over: Literal["share", "all", "mean", "median", "worst"] = "share"
    visibility: Literal["visible", "hidden", "after_due_date", "after_published"] = "visible"


class Finishes(_Criterion):
    """The program ends by itself, without a fault of its own, within ``seconds`` if given.

    A responder that raises or answers badly does not make the program fail; running out of time, CPU or
    memory does.
    """

    check: Literal["finishes"]
    seconds: float | None = Field(default=None, gt=0)


class _TextConditions(_Criterion):
    """Which texts count. A text counts if every condition that is given holds for it."""

    equals: Texts = ()  # the text is one of these
    starts_with: Texts = ()  # begins with one of these
    contains: Texts = ()  # has all of these in it
    matches: str | None = None  # a regular expression, found anywhere in the text
    ignore_case: bool = False

    @field_validator("equals", "starts_with", "contains", mode="before")
    @classmethod
    def _lists(cls, value: object) -> object:
        return _one_or_many(value)

    @field_validator("starts_with", "contains")
    @classmethod
    def _something(cls, value: Texts) -> Texts:
        return _not_blank(value)

    @field_validator("matches")
    @classmethod
    def _compiles(cls, value: str | None) -> str | None:
        if value is not None:
            try:
                re.compile(value)
            except re.error as error:
                raise ValueError(
                    f"is not a regular expression ({error}), expected one that Python's re reads"
                ) from None
        return value

    @property
    def has_conditions(self) -> bool:
        return bool(self.equals or self.starts_with or self.contains or self.matches is not None)


class _TextSequence(_TextConditions):
    """How many texts must count, and in which order.

    Without a count at least one must; with ``in_order`` the listed texts must come in that order among
    those that count (others may lie between them unless ``only``), compared as ``compare`` says. ``last``
    looks at the last text alone.
    """

    last: bool = False
    in_order: Texts = ()
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
                "asks for nothing, expected one of equals, contains, starts_with, matches, in_order, "
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
                "has last without a condition, expected equals, contains, starts_with or matches beside it"
            )
        if self.only and not self.in_order:
            raise ValueError("has only without in_order, expected the texts in order")
        if self.compare == "matches":
            for pattern in self.in_order:
                try:
                    re.compile(pattern)
                except re.error as error:
                    raise ValueError(f"has in in_order what is not a regular expression ({error}): {pattern}") from None
        return self

    def _asks_more(self) -> bool:
        return False


class Prints(_TextSequence):
    """What the program prints, one text a print call."""

    check: Literal["prints"]


class Says(_TextSequence):
    """What the robot says."""

    check: Literal["says"]


class Messages(_TextSequence):
    """What the robot sends to the responder: texts like ``PY::0``; a picture is the text ``IMG_DATA::...``.

    With ``json = true`` it is, instead, the robot's queue that is looked at: every answer that began with
    ``JSON::``, was well formed and arrived while the program ran, in order of arrival; ``path`` picks the
    part that is compared (``message.shape``; a number picks from a list). ``queue_grows = true`` asks that
    each ``PY::`` message made the queue longer by one, in the order in which the messages were sent.
    """

    check: Literal["messages"]
    json_queue: bool = Field(default=False, alias="json")
    path: str | None = Field(default=None, min_length=1)
    queue_grows: bool = False

    @model_validator(mode="after")
    def _path_needs_json(self) -> Self:
        if self.path is not None and not self.json_queue:
            raise ValueError("has path without json, expected json = true beside it")
        return self

    def _asks_more(self) -> bool:
        return self.queue_grows


class Replies(_TextConditions):
    """What the responder answers, arrived in time or not.

    ``expect`` maps a text of the robot's to its answer: each must have been sent, and answered so.
    Otherwise every message of the robot's that reached the responder must have an answer that meets the
    conditions, and there must be ``at_least`` of them (1); ``to`` and ``to_starts_with`` narrow down which
    messages are looked at. ``is_json`` asks for ``JSON::`` and well-formed JSON; with ``path`` the
    conditions, ``value`` and ``expect`` apply to what the JSON has there (``message.typ``), else to the
    whole answer.
    """

    check: Literal["replies"]
    to: Texts = ()
    to_starts_with: Texts = ()
    expect: dict[str, Any] = Field(default_factory=dict)
    at_least: int = Field(default=1, ge=0)
    is_json: bool = False
    path: str | None = Field(default=None, min_length=1)
    value: Any = None

    @field_validator("to", "to_starts_with", mode="before")
    @classmethod
    def _to_lists(cls, value: object) -> object:
        return _one_or_many(value)

    @model_validator(mode="after")
    def _fits(self) -> Self:
        if self.value is not None and self.path is None:
            raise ValueError('has value without path, expected path = "message" or the like beside it')
        if self.expect and (self.to or self.to_starts_with or self.has_conditions or self.value is not None):
            raise ValueError("has expect beside other conditions, expected expect alone (with path and ignore_case)")
        if self.path is None and any(not isinstance(answer, str) for answer in self.expect.values()):
            raise ValueError("has an answer in expect that is not a text, expected texts, or path beside them")
        return self


class Classification(_Criterion):
    """How often the pictures that the robot sends are named rightly; all trials are pooled.

    ``truth`` is ``"label"`` (what the floor has under the left sensor when the picture was taken) or a
    list, one label for each pose of the scenario. The answer is looked for in the reply to the picture, at
    ``answer`` in its JSON if there is such a place, else in the reply's text; with ``answer_from`` in what
    the robot said or printed between this picture and the next. Case, hyphens and ``aliases`` (label to
    other names for it) do not matter; an answer that names two different labels is wrong. ``pictures`` says
    which of a trial's pictures count. A trial without a picture counts as one wrong answer, so that staying
    silent never helps.

    Marks: without ``at_least`` the marks times the accuracy. With it, all marks from that accuracy on, and
    ``marks x accuracy / at_least`` below. ``over = "all"``: all marks from ``at_least`` (1 if not given)
    on, else none.
    """

    check: Literal["classification"]
    truth: Literal["label"] | tuple[str, ...] = "label"
    answer: str | None = Field(default=None, min_length=1)
    answer_from: Literal["reply", "speech", "print"] = "reply"
    labels: tuple[str, ...] = ()  # all that could be named; without it those that the floor and the truths have
    aliases: dict[str, Texts] = Field(default_factory=dict)
    pictures: Literal["all", "first", "last"] = "all"
    at_least: float | None = Field(default=None, gt=0, le=1)

    @field_validator("truth", mode="plain")
    @classmethod
    def _label_or_list(cls, value: object) -> object:
        if value == "label":
            return value
        if isinstance(value, list | tuple) and value and all(isinstance(label, str) and label for label in value):
            return tuple(value)
        raise ValueError('is neither "label" nor a list of labels, expected "label" or one label for each pose')

    @field_validator("aliases", mode="before")
    @classmethod
    def _alias_lists(cls, value: object) -> object:
        return {key: _one_or_many(names) for key, names in value.items()} if isinstance(value, dict) else value

    @field_validator("over")
    @classmethod
    def _pooled(cls, value: str, info: ValidationInfo) -> str:
        if value not in ("share", "all"):
            raise ValueError('is for criteria judged trial by trial, expected "share" or "all"')
        return value


class EndPose(_Criterion):
    """Where the robot is at the end: near a point, at a heading, or in a zone; all that is given must hold.

    ``tolerance`` is in mm from (x, y), ``heading_tolerance`` in degrees, full turns ignored; ``zone`` is
    [left, bottom, right, top] in mm and is about the middle of the axle.
    """

    check: Literal["pose"]
    x: float | None = None
    y: float | None = None
    tolerance: float = Field(default=20.0, ge=0)
    heading: float | None = None
    heading_tolerance: float = Field(default=5.0, ge=0, le=180)
    zone: tuple[float, float, float, float] | None = None

    @model_validator(mode="after")
    def _fits(self) -> Self:
        if (self.x is None) != (self.y is None):
            raise ValueError("has one of x and y, expected both")
        if self.x is None and self.heading is None and self.zone is None:
            raise ValueError("asks for nothing, expected x and y, heading or zone")
        if self.zone is not None and not (self.zone[0] < self.zone[2] and self.zone[1] < self.zone[3]):
            raise ValueError("has an empty zone, expected [left, bottom, right, top]")
        return self


Criterion = Annotated[
    Finishes | Prints | Says | Messages | Replies | Classification | EndPose, Field(discriminator="check")
]

#: The schema for each value of ``check``.
SCHEMAS: dict[str, type[_Criterion]] = {
    "finishes": Finishes,
    "prints": Prints,
    "says": Says,
    "messages": Messages,
    "replies": Replies,
    "classification": Classification,
    "pose": EndPose,
}
