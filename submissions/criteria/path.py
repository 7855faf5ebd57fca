"""Criteria about where the robot goes: through places, within areas, clear of them, touching nothing.

Lines to follow are ``line.py``'s, drawings ``drawing.py``'s, points to keep to or go round ``point.py``'s.
"""

from __future__ import annotations

from typing import ClassVar, Literal, Self

from pydantic import Field, model_validator

from submissions.criteria.common import Criterion, Texts
from submissions.criteria.places import Area, Part


class Visits(Criterion):
    """The robot comes through every place, in the order of the list unless ``in_order = false``.

    ``at_least`` is how many of them are enough. With ``without_stopping`` it must not stand still (for more
    than half a second, nor at the end) in any of them. The score is the share of them that were reached.
    """

    check: Literal["visits"]
    measures: ClassVar[Texts] = ("places visited",)
    places: tuple[Area, ...] = Field(min_length=1)
    in_order: bool = True
    at_least: int | None = Field(default=None, ge=1)
    without_stopping: bool = False
    of: Part = "robot"

    @model_validator(mode="after")
    def _enough(self) -> Self:
        if self.at_least is not None and self.at_least > len(self.places):
            raise ValueError(f"has at_least = {self.at_least} of {len(self.places)} places, expected as many or fewer")
        return self


class StaysInside(Criterion):
    """At all times ``of`` is in one of the areas.

    ``drives`` is how far the robot must drive in all, mm, so that standing still earns nothing.
    """

    check: Literal["stays_inside"]
    measures: ClassVar[Texts] = ("farthest out", "least x", "greatest x", "least y", "greatest y")
    areas: tuple[Area, ...] = Field(min_length=1)
    of: Part = "robot"
    drives: float = Field(default=0.0, ge=0)


class KeepsOut(Criterion):
    """At no time is ``of`` in any of the areas, nor nearer to one than ``clear_of`` mm.

    ``drives`` is how far the robot must drive in all, mm, so that standing still earns nothing.
    """

    check: Literal["keeps_out"]
    measures: ClassVar[Texts] = ("least clearance", "least x", "greatest x", "least y", "greatest y")
    areas: tuple[Area, ...] = Field(min_length=1)
    of: Part = "robot"
    clear_of: float = Field(default=0.0, ge=0)
    drives: float = Field(default=0.0, ge=0)


class TouchesNothing(Criterion):
    """The robot's body touches no wall and no obstacle; ``at_most`` touches are forgiven."""

    check: Literal["touches_nothing"]
    measures: ClassVar[Texts] = ("touches",)
    at_most: int = Field(default=0, ge=0)
