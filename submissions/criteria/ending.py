"""Criteria about how a run ends: by itself, in time, and where.

What happened on the way there is asked in the other modules.
"""

from __future__ import annotations

from typing import ClassVar, Literal, Self

from pydantic import Field, model_validator

from submissions.criteria.common import Criterion, Texts
from submissions.criteria.places import Area, Zone


class Finishes(Criterion):
    """The program ends by itself, without a fault of its own, within ``seconds`` if given.

    A responder that raises or answers badly does not make the program fail; running out of time, CPU or
    memory does.
    """

    check: Literal["finishes"]
    measures: ClassVar[Texts] = ("time",)
    seconds: float | None = Field(default=None, gt=0)


class EndPose(Criterion):
    """Where the robot is at the end: near a point, at a heading, in a zone; all that is given must hold.

    ``tolerance`` is in mm from (x, y), ``heading_tolerance`` in degrees, full turns ignored; ``zone`` is
    [left, bottom, right, top] in mm. ``areas`` are areas of which the robot must be in one. All are about
    the middle of the axle.
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

    @model_validator(mode="after")
    def _fits(self) -> Self:
        if (self.x is None) != (self.y is None):
            raise ValueError("has one of x and y, expected both")
        if self.x is None and self.heading is None and self.zone is None and not self.areas:
            raise ValueError("asks for nothing, expected x and y, heading, zone or areas")
        return self
