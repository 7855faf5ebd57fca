"""Criteria about how a run ends: by itself, in time, and where.

What happened on the way there is asked in the other modules.
"""

from __future__ import annotations

from typing import Annotated, ClassVar, Literal, Self

from pydantic import Field, model_validator

from submissions.criteria.common import Criterion, Texts
from submissions.criteria.places import Area, Range, Zone
from submissions.strict_table import StrictTable


class Finishes(Criterion):
    """The program ends by itself, without a fault of its own, within ``seconds`` if given.

    A responder that raises or answers badly does not make the program fail; running out of time, CPU or
    memory does.
    """

    check: Literal["finishes"]
    measures: ClassVar[Texts] = ("time",)
    seconds: float | None = Field(default=None, gt=0)


class SinceEvent(StrictTable):
    """How far the robot is, at the end, from where it was when a text came first, and how long ago that was.

    ``of`` says which text: one that the robot ``"sent"``, ``"said"`` or ``"printed"``, or was ``"answered"``.
    """

    of: Literal["sent", "answered", "said", "printed"]
    contains: Annotated[str, Field(min_length=1)]
    moved: Range | None = None  # mm
    seconds: Range | None = None

    @model_validator(mode="after")
    def _asks_something(self) -> Self:
        if self.moved is None and self.seconds is None:
            raise ValueError("asks for nothing, expected moved = [least, most] in mm, seconds = [least, most] or both")
        return self


class EndPose(Criterion):
    """Where the robot is at the end: near a point, at a heading, in a zone; all that is given must hold.

    ``tolerance`` is in mm from (x, y), ``heading_tolerance`` in degrees, full turns ignored; ``zone`` is
    [left, bottom, right, top] in mm. ``areas`` are areas of which the robot must be in one. All are about
    the middle of the axle. ``since`` is about an event: ``{ of = "answered", contains = "stop", moved = [0, 150] }``.
    """

    check: Literal["pose"]
    measures: ClassVar[Texts] = ("end x", "end y", "end heading", "time", "displacement", "bearing")
    x: float | None = None
    y: float | None = None
    tolerance: float = Field(default=20.0, ge=0)
    heading: float | None = None
    heading_tolerance: float = Field(default=5.0, ge=0, le=180)
    zone: Zone | None = None
    areas: tuple[Area, ...] = ()
    since: SinceEvent | None = None

    @model_validator(mode="after")
    def _fits(self) -> Self:
        if (self.x is None) != (self.y is None):
            raise ValueError("has one of x and y, expected both")
        asked = (self.x, self.heading, self.zone, self.areas or None, self.since)
        if all(each is None for each in asked):
            raise ValueError("asks for nothing, expected x and y, heading, zone, areas or since")
        return self
