"""Criteria about the path: through places, inside areas, outside areas, without touching anything.

Lines are in ``line.py``, drawings in ``drawing.py``, and points in ``point.py``.
"""

from __future__ import annotations

from typing import ClassVar, Literal, Self

from pydantic import Field, model_validator

from submissions.criteria.common import Criterion, Texts
from submissions.criteria.places import Area, Part
from submissions.strict_table import TableMistake


class Visits(Criterion):
    """The robot visits every place, in the order of the list unless ``in_order = false``.

    ``at_least`` is the number of visits that is enough. With ``without_stopping``, the robot must not stop in any place
    for more than half a second, or end there. The score is the share of places visited.
    """

    check: Literal["visits"]
    measures: ClassVar[Texts] = ("places visited",)
    places: tuple[Area, ...] = Field(min_length=1)
    in_order: bool = True
    at_least: int | None = Field(default=None, ge=1)
    without_stopping: bool = False
    of: Part = "robot"

    @model_validator(mode="after")
    def _check_visit_count(self) -> Self:
        if self.at_least is not None and self.at_least > len(self.places):
            raise TableMistake(
                "at_least", f"has at_least = {self.at_least} of {len(self.places)} places, expected as many or fewer"
            )
        return self


class StaysInside(Criterion):
    """``of`` is always in one of the areas.

    ``drives`` is the minimum total distance in mm, so that a robot that does not move gets no marks.
    """

    check: Literal["stays_inside"]
    measures: ClassVar[Texts] = ("farthest out", "least x", "greatest x", "least y", "greatest y")
    areas: tuple[Area, ...] = Field(min_length=1)
    of: Part = "robot"
    drives: float = Field(default=0.0, ge=0)


class KeepsOut(Criterion):
    """``of`` is never in any of the areas, and never closer to one than ``clear_of`` mm.

    ``drives`` is the minimum total distance in mm, so that a robot that does not move gets no marks.
    """

    check: Literal["keeps_out"]
    measures: ClassVar[Texts] = ("least clearance", "least x", "greatest x", "least y", "greatest y")
    areas: tuple[Area, ...] = Field(min_length=1)
    of: Part = "robot"
    clear_of: float = Field(default=0.0, ge=0)
    drives: float = Field(default=0.0, ge=0)


class TouchesNothing(Criterion):
    """The robot's body touches no wall and no obstacle; up to ``at_most`` touches are allowed."""

    check: Literal["touches_nothing"]
    measures: ClassVar[Texts] = ("touches",)
    at_most: int = Field(default=0, ge=0)
