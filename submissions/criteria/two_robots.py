"""Criterion about two robots: their distance during the run and at the end.

Other criteria judge each robot by itself; ``robot`` selects the second.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Literal, Self

from pydantic import Field, model_validator

from submissions.criteria.common import AssignmentContext, Criterion, UnmetRequirement
from submissions.strict_table import TableMistake


class Apart(Criterion):
    """Distance between the middles of the two robots' axles: ``at_least`` and ``at_most`` mm.

    ``when`` selects the time: at the end, always from ``after`` seconds on, or once from then on. For "always", the
    score is the share of the time that meets the condition, and ``share`` of the time is enough. A robot stays in place
    after its program has ended.
    """

    check: Literal["apart"]
    at_least: float = Field(default=0.0, ge=0)
    at_most: float | None = Field(default=None, gt=0)
    when: Literal["end", "always", "once"] = "end"
    after: float = Field(default=0.0, ge=0)
    share: float = Field(default=1.0, gt=0, le=1)

    @model_validator(mode="after")
    def _check_distance_given(self) -> Self:
        if self.at_most is None and self.at_least == 0:
            raise ValueError("has no condition, expected at_least or at_most")
        if self.at_most is not None and self.at_most < self.at_least:
            raise TableMistake("at_most", "has an at_most below at_least, expected room between them")
        return self

    def find_unmet_requirements(self, context: AssignmentContext) -> Iterator[UnmetRequirement]:
        """Yield a problem if there is only one robot, or if ``robot`` selects one of the two."""
        if self.robot != 1:
            yield UnmetRequirement("robot", "robot is 2, but check looks at both robots, expected it without robot")
        if context.robots < 2:
            yield UnmetRequirement("check", "check is about two robots, but there is one, expected robots = 2 in world")
