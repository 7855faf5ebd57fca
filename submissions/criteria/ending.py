"""Criteria about the end of a run: its cause, time and place.

Criteria about the way there are in the other modules.
"""

from __future__ import annotations

from typing import Annotated, ClassVar, Literal, Self

from pydantic import Field, model_validator

from submissions.criteria.common import Criterion, Texts
from submissions.criteria.places import Area, Range, Zone
from submissions.strict_table import StrictTable, TableMistake


class Finishes(Criterion):
    """The program ends by itself and without a fault in its code, within ``seconds`` if given.

    Errors of the responder do not count as a fault of the program. Exceeding the limits on time, CPU or memory does.
    """

    check: Literal["finishes"]
    measures: ClassVar[Texts] = ("time",)
    seconds: float | None = Field(default=None, gt=0)


class SinceEvent(StrictTable):
    """Distance and time between the first occurrence of a text and the end.

    ``of`` selects the text: ``"sent"``, ``"said"`` or ``"printed"`` by the robot, or ``"answered"`` to it.
    """

    of: Literal["sent", "answered", "said", "printed"]
    contains: Annotated[str, Field(min_length=1)]
    moved: Range | None = None  # mm
    seconds: Range | None = None

    @model_validator(mode="after")
    def _check_has_condition(self) -> Self:
        if self.moved is None and self.seconds is None:
            raise ValueError("has no condition, expected moved = [least, most] in mm, seconds = [least, most] or both")
        return self


class EndPose(Criterion):
    """Pose of the robot at the end: near a point, at a heading, in a zone. All given conditions must hold.

    ``tolerance`` is the distance from (x, y) in mm; ``heading_tolerance`` is in degrees and ignores full turns.
    ``zone`` is [left, bottom, right, top] in mm. The robot must be in one of ``areas``. All conditions apply to the
    middle of the axle. ``since`` measures from an event: ``{ of = "answered", contains = "stop", moved = [0, 150] }``.
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
    def _check_options(self) -> Self:
        if (self.x is None) != (self.y is None):
            raise TableMistake("x", "has one of x and y, expected both")
        conditions = (self.x, self.heading, self.zone, self.areas or None, self.since)
        if all(each is None for each in conditions):
            raise ValueError("has no condition, expected x and y, heading, zone, areas or since")
        return self
