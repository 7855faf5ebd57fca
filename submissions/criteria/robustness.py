"""Criterion about image classification under harder conditions.

The conditions are defined in ``assignment/scenario.py``.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Literal, Self

from pydantic import Field, model_validator

from submissions.assignment.scenario import Condition
from submissions.criteria.common import AssignmentContext, UnmetRequirement
from submissions.criteria.recognition import Recognition
from submissions.strict_table import TableMistake


class Robustness(Recognition):
    """Accuracy of image classification as one swept condition gets harder.

    ``along`` is a condition of the scenario's sweep.

    - ``marks_from = "area"``: the marks times the mean height of the accuracy curve (the area under it divided by the
      width of the sweep).
    - ``marks_from = "falls_below"``: the marks times the part of the sweep, from its easiest level, with an accuracy of
      at least ``level``.
    - With ``at_least``: full marks from that area or part, and proportional marks below it.
    """

    check: Literal["robustness"]
    along: Condition
    marks_from: Literal["area", "falls_below"] = "area"
    level: float | None = Field(default=None, gt=0, le=1)

    def find_unmet_requirements(self, context: AssignmentContext) -> Iterator[UnmetRequirement]:
        """Yield the problems of recognition, and a problem if no scenario has a sweep over the condition."""
        yield from super().find_unmet_requirements(context)
        if not any(scenario.varies(self.along) for scenario in context.find_scenarios(self)):
            yield UnmetRequirement(
                "along",
                f'along is "{self.along}", but no scenario of the criterion is swept over it, '
                f"expected [scenario.sweep] with {self.along} = [...]",
            )

    @model_validator(mode="after")
    def _check_level(self) -> Self:
        if (self.level is not None) != (self.marks_from == "falls_below"):
            raise TableMistake(
                "level", 'needs level with marks_from = "falls_below", and only there, expected both or neither'
            )
        return self
