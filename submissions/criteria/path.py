"""Criteria about where the robot goes: through places, within areas, clear of them, round and near a point.

Only what is asked; lines to follow and images to draw have their own modules.
"""

from __future__ import annotations

from typing import Literal, Self

from pydantic import Field, field_validator, model_validator

from submissions.criteria.common import CriterionBase
from submissions.criteria.places import Area, Part, Range, ordered


class Visits(CriterionBase):
    """The robot comes through every place, in the order of the list unless ``in_order = false``.

    ``at_least`` is how many of them are enough. With ``without_stopping`` it must not stand still (for more
    than half a second, nor at the end) in any of them. The score is the share of them that were reached.
    """

    check: Literal["visits"]
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


class StaysInside(CriterionBase):
    """At all times ``of`` is in one of the areas.

    ``drives`` is how far the robot must drive in all, mm, so that standing still earns nothing.
    """

    check: Literal["stays_inside"]
    areas: tuple[Area, ...] = Field(min_length=1)
    of: Part = "robot"
    drives: float = Field(default=0.0, ge=0)


class KeepsOut(CriterionBase):
    """At no time is ``of`` in any of the areas.

    ``drives`` is how far the robot must drive in all, mm, so that standing still earns nothing.
    """

    check: Literal["keeps_out"]
    areas: tuple[Area, ...] = Field(min_length=1)
    of: Part = "robot"
    drives: float = Field(default=0.0, ge=0)


class TouchesNothing(CriterionBase):
    """The robot's body touches no wall and no obstacle; ``at_most`` touches are forgiven."""

    check: Literal["touches_nothing"]
    at_most: int = Field(default=0, ge=0)


class Closest(CriterionBase):
    """How near the path comes to the point (x, y): ``distance`` is [least, most] of the least distance, mm.

    ``than_straight`` compares it with driving straight on from the start; ``first_turn`` asks for the
    direction of the first turn of more than 2 degrees.
    """

    check: Literal["closest"]
    x: float
    y: float
    distance: Range | None = None
    than_straight: Literal["nearer", "farther"] | None = None
    first_turn: Literal["towards", "away"] | None = None

    @field_validator("distance")
    @classmethod
    def _ordered(cls, value: Range | None) -> Range | None:
        return ordered(value)

    @model_validator(mode="after")
    def _asks_something(self) -> Self:
        if self.distance is None and self.than_straight is None and self.first_turn is None:
            raise ValueError("asks for nothing, expected one of distance, than_straight and first_turn")
        return self


class Circuits(CriterionBase):
    """How often the path goes round the point (x, y): ``times`` is [least, most], parts of a round included.

    ``direction`` is on the screen; ``clear_of`` is how far from the point it must always be, mm, so that spinning
    beside it is no round. ``gyro`` is [least, most] of how much the gyro changes in each whole
    round, degrees, without regard to the direction; ``corners`` is in how many about equal steps it does so.
    """

    check: Literal["circuits"]
    x: float
    y: float
    times: Range
    direction: Literal["either", "clockwise", "anticlockwise"] = "either"
    of: Literal["robot", "pen"] = "robot"
    clear_of: float = Field(default=0.0, ge=0)
    gyro: Range | None = None
    corners: int | None = Field(default=None, ge=1)

    @field_validator("times", "gyro")
    @classmethod
    def _ordered(cls, value: Range | None) -> Range | None:
        return ordered(value)

    @model_validator(mode="after")
    def _whole_round(self) -> Self:
        if (self.gyro is not None or self.corners is not None) and self.times[0] < 1:
            raise ValueError("looks at whole rounds with gyro or corners, expected times to begin at 1 or above")
        return self


class Spread(CriterionBase):
    """An observation: how far from (x, y) the robot ended in each trial, and how much that varies.

    The feedback gives least, mean and greatest distance for each level of motor noise. Without ``within``
    nothing can be lost by it, so ``marks = 0`` fits; with it a trial passes that ends at most so many mm away.
    """

    check: Literal["spread"]
    x: float
    y: float
    within: float | None = Field(default=None, gt=0)
