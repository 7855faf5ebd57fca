"""Criteria about a point of the floor: how near the path comes to it, how often it goes round, how far from it it ends.

Places to come through or to keep out of are asked in ``path.py``.
"""

from __future__ import annotations

from typing import ClassVar, Literal, Self

from pydantic import Field, model_validator

from submissions.criteria.common import Criterion, Texts
from submissions.criteria.places import Range


class Closest(Criterion):
    """How near the path comes to the point (x, y): ``distance`` is [least, most] of the least distance, mm.

    ``than_straight`` compares it with driving straight on from the start; ``first_turn`` asks for the
    direction of the first turn of more than 2 degrees.
    """

    check: Literal["closest"]
    measures: ClassVar[Texts] = ("least distance", "straight on")
    x: float
    y: float
    distance: Range | None = None
    than_straight: Literal["nearer", "farther"] | None = None
    first_turn: Literal["towards", "away"] | None = None

    @model_validator(mode="after")
    def _asks_something(self) -> Self:
        if self.distance is None and self.than_straight is None and self.first_turn is None:
            raise ValueError("asks for nothing, expected one of distance, than_straight and first_turn")
        return self


class Circuits(Criterion):
    """How often the path goes round the point (x, y): ``times`` is [least, most], parts of a round included.

    ``direction`` is on the screen; ``clear_of`` is how far from the point it must always be, mm, so that spinning
    beside it is no round. ``gyro`` is [least, most] of how much the gyro changes in each whole
    round, degrees, without regard to the direction; ``corners`` is in how many about equal steps it does so.
    """

    check: Literal["circuits"]
    measures: ClassVar[Texts] = ("times round", "gyro in round #", "corners in round #")
    x: float
    y: float
    times: Range
    direction: Literal["either", "clockwise", "anticlockwise"] = "either"
    of: Literal["robot", "pen"] = "robot"
    clear_of: float = Field(default=0.0, ge=0)
    gyro: Range | None = None
    corners: int | None = Field(default=None, ge=1)

    @model_validator(mode="after")
    def _whole_round(self) -> Self:
        if (self.gyro is not None or self.corners is not None) and self.times[0] < 1:
            raise ValueError("looks at whole rounds with gyro or corners, expected times to begin at 1 or above")
        return self


class Spread(Criterion):
    """An observation: how far from (x, y) the robot ended in each trial, and how much that varies.

    The feedback gives least, mean and greatest distance for each level of motor noise. Without ``within``
    nothing can be lost by it, so ``marks = 0`` fits; with it a trial passes that ends at most so many mm away.
    """

    check: Literal["spread"]
    measures: ClassVar[Texts] = ("distance from the target",)
    x: float
    y: float
    within: float | None = Field(default=None, gt=0)
