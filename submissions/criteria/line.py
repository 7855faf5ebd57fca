"""Criteria about line following and laps of a circuit.

Lines are defined in ``places.py``.
"""

from __future__ import annotations

from typing import Annotated, ClassVar, Literal, Self

from pydantic import Field, model_validator

from submissions.criteria.common import Criterion, Texts
from submissions.criteria.places import LineToFollow, Part, Range
from submissions.strict_table import Entries, TableMistake


class Follows(Criterion):
    """The robot drives along a line.

    The robot is on the line while it is ``within`` mm of it. ``covers`` is the share of the line that it must follow,
    in the line's direction and without gaps. A line with two ends counts from the point where the robot first reaches
    it, but at the latest from the share ``joins_by`` of its length. A closed line counts as a whole.

    ``at_most`` is the maximum distance from the line while the robot follows it. ``one_side`` is the minimum share of
    the time on one side of the line.
    """

    check: Literal["follows"]
    measures: ClassVar[Texts] = ("share covered", "farthest off", "mean off", "seconds to the end", "share on one side")
    line: LineToFollow
    within: float = Field(default=50.0, gt=0)
    covers: float = Field(default=0.9, gt=0, le=1)
    joins_by: float = Field(default=0.1, ge=0, lt=1)
    at_most: float | None = Field(default=None, gt=0)
    one_side: float | None = Field(default=None, gt=0.5, le=1)
    of: Part = "robot"

    @model_validator(mode="after")
    def _check_options(self) -> Self:
        if self.at_most is not None and self.at_most < self.within:
            raise TableMistake("at_most", "has an at_most below its within, expected at_most >= within")
        return self


class Laps(Criterion):
    """Whole laps of a closed line, each timed from one crossing of the start line to the next.

    ``start_line`` is [x1, y1, x2, y2]. ``laps`` laps must follow the line's direction, each along at least ``progress``
    of it and at most ``within`` mm away. ``seconds`` is [least, most] for the best lap.
    """

    check: Literal["laps"]
    measures: ClassVar[Texts] = ("lap time", "laps", "farthest off", "part of a lap")
    line: LineToFollow
    start_line: Annotated[tuple[float, float, float, float], Entries("[x1, y1, x2, y2]")]
    laps: int = Field(default=1, ge=1)
    within: float = Field(default=60.0, gt=0)
    progress: float = Field(default=0.995, gt=0, le=1)
    seconds: Range | None = None

    @model_validator(mode="after")
    def _check_options(self) -> Self:
        if not self.line.is_closed:
            raise TableMistake("line", "has a line with two ends, expected a closed one (closed = true)")
        if self.start_line[:2] == self.start_line[2:]:
            raise TableMistake("line", "has a start line without length, expected [x1, y1, x2, y2]")
        return self
