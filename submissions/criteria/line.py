"""Criteria about following a line and driving laps of a circuit.

Only what is asked; a line is described as ``places.py`` has it.
"""

from __future__ import annotations

from typing import Annotated, ClassVar, Literal, Self

from pydantic import Field, model_validator

from submissions.criteria.common import Criterion, Texts
from submissions.criteria.places import LineToFollow, Part, Range
from submissions.strict_table import Entries


class Follows(Criterion):
    """The robot drives along a line.

    It is on the line while it is ``within`` mm of it; ``covers`` is the share of the line that it must be on, in the
    line's direction and without leaving parts out. A line with two ends counts from where the robot first comes
    upon it, or from the share ``joins_by`` of its length if the robot comes upon it later than that; a closed line
    counts as a whole. ``at_most`` is the farthest it may ever be from the line while it follows. ``one_side`` asks
    that it is on one and the same side of the line for this share of the time.
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
    def _fits(self) -> Self:
        if self.at_most is not None and self.at_most < self.within:
            raise ValueError("has an at_most below its within, expected at_most >= within")
        return self


class Laps(Criterion):
    """Whole laps of a closed line, timed from crossing the start line to crossing it again.

    ``start_line`` is [x1, y1, x2, y2]. ``laps`` must be driven in the line's direction, each along at least
    ``progress`` of it and never farther than ``within`` mm from it; ``seconds`` is [least, most] of the
    best lap's time.
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
    def _fits(self) -> Self:
        if not self.line.is_closed:
            raise ValueError("has a line with two ends, expected a closed one (closed = true)")
        if self.start_line[:2] == self.start_line[2:]:
            raise ValueError("has a start line without length, expected [x1, y1, x2, y2]")
        return self
