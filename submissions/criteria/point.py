"""Criteria about a point on the floor: the path's distance from it, the turns round it, and the final distance.

Criteria about places to visit or avoid are in ``path.py``.
"""

from __future__ import annotations

from typing import ClassVar, Literal, Self

from pydantic import Field, model_validator

from submissions.criteria.common import Criterion, Texts
from submissions.criteria.places import Range
from submissions.strict_table import TableMistake


class Closest(Criterion):
    """Minimum distance of the path from the point (x, y): ``distance`` is [least, most] in mm.

    ``than_straight`` compares it with straight driving from the start pose. ``first_turn`` is the required direction of
    the first turn of more than 2 degrees.
    """

    check: Literal["closest"]
    measures: ClassVar[Texts] = ("least distance", "straight on")
    x: float
    y: float
    distance: Range | None = None
    than_straight: Literal["nearer", "farther"] | None = None
    first_turn: Literal["towards", "away"] | None = None

    @model_validator(mode="after")
    def _check_has_condition(self) -> Self:
        if self.distance is None and self.than_straight is None and self.first_turn is None:
            raise ValueError("has no condition, expected one of distance, than_straight and first_turn")
        return self


class Circuits(Criterion):
    """Number of turns of the path round the point (x, y): ``times`` is [least, most], fractions included.

    ``direction`` is as seen on the screen. ``clear_of`` is the minimum distance from the point in mm, so that spinning
    beside it does not count. ``gyro`` is [least, most] of the gyro's absolute change in degrees per whole turn.
    ``corners`` is the number of roughly equal steps of this change.
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
    def _check_whole_rounds(self) -> Self:
        if (self.gyro is not None or self.corners is not None) and self.times[0] < 1:
            raise TableMistake(
                "gyro", "looks at whole rounds with gyro or corners, expected times to begin at 1 or above"
            )
        return self


class Spread(Criterion):
    """An observation: the final distances from (x, y) over all trials, and their spread.

    The feedback gives the minimum, mean and maximum distance for each level of motor noise. Without ``within``, the
    criterion cannot fail, so use ``marks = 0``. With it, trials pass if they end at most that many mm away.
    """

    check: Literal["spread"]
    measures: ClassVar[Texts] = ("distance from the target",)
    x: float
    y: float
    within: float | None = Field(default=None, gt=0)
