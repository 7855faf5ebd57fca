"""Criteria about two robots: how far they are apart, on the way and at the end.

What one of them does is asked by the other criteria, with ``robot`` where it is the second.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Literal, Self

from pydantic import Field, model_validator

from submissions.criteria.common import Criterion, Misfit, Surroundings


class Apart(Criterion):
    """How far the middles of the two robots' axles are apart: ``at_least`` and ``at_most`` mm.

    ``when`` is at the end, always from ``after`` seconds on (the score is the share of that time in which it was so,
    and ``share`` of it is enough), or once from then on. A robot whose program has ended stands where it is.
    """

    check: Literal["apart"]
    at_least: float = Field(default=0.0, ge=0)
    at_most: float | None = Field(default=None, gt=0)
    when: Literal["end", "always", "once"] = "end"
    after: float = Field(default=0.0, ge=0)
    share: float = Field(default=1.0, gt=0, le=1)

    @model_validator(mode="after")
    def _asks(self) -> Self:
        if self.at_most is None and self.at_least == 0:
            raise ValueError("asks for nothing, expected at_least or at_most")
        if self.at_most is not None and self.at_most < self.at_least:
            raise ValueError("has an at_most below at_least, expected room between them")
        return self

    def misfits(self, around: Surroundings) -> Iterator[Misfit]:
        """It takes two, and looks at both."""
        if self.robot != 1:
            yield Misfit("robot", "robot is 2, but check looks at both robots, expected it without robot")
        if around.robots < 2:
            yield Misfit("check", "check is about two robots, but there is one, expected robots = 2 in world")
