"""Criteria about time and about ranking by a measured value.

The criterion about the program's end is in ``ending.py``.
"""

from __future__ import annotations

from collections.abc import Iterator
from itertools import pairwise
from typing import Annotated, ClassVar, Literal, Self

from pydantic import Field, model_validator

from submissions.criteria.common import AssignmentContext, Criterion, Texts, UnmetRequirement
from submissions.criteria.places import Range
from submissions.strict_table import Entries, TableMistake
from submissions.suggestions import join_with_or, suggest_name


class Timing(Criterion):
    """Duration in seconds of simulated time, from ``between[0]`` to ``between[1]``.

    ``of = "program"`` is the time from the start to the program's end. ``"moving"`` is the time during which the robot
    moved or turned. ``"speech"`` is the time until the end of the last speech.
    """

    check: Literal["timing"]
    measures: ClassVar[Texts] = ("time",)
    of: Literal["program", "moving", "speech"] = "program"
    between: Range


class Ranking(Criterion):
    """Marks by steps for a value that another criterion measures, for example the fastest lap.

    ``of`` is the id of that criterion, and ``measure`` is the name of the value in reports. ``steps`` are [value,
    share]: up to this value (``highest = true``: from this value) the trial gets that share of the marks. A trial that
    fails the other criterion gets nothing. The value is also used for a ranking table.
    """

    check: Literal["ranking"]
    of: str = Field(min_length=1, max_length=80)
    measure: str = Field(min_length=1, max_length=60)
    steps: tuple[Annotated[tuple[float, float], Entries("[figure, share]")], ...] = Field(min_length=1)
    highest: bool = False
    over: Literal["share", "all", "mean", "median", "worst"] = "mean"

    @property
    def result_needed(self) -> str:
        """The criterion whose value is ranked."""
        return self.of

    def find_unmet_requirements(self, context: AssignmentContext) -> Iterator[UnmetRequirement]:
        """Yield a problem if the ranked criterion does not exist, needs another's result, or lacks the value."""
        # A criterion that needs another's result is judged too late to be ranked.
        criteria_by_id = {each.id: each for each in context.criteria if each.result_needed is None}
        if self.of not in criteria_by_id:
            hint = suggest_name(self.of, criteria_by_id)
            yield UnmetRequirement("of", f'of is "{self.of[:60]}", expected the id of another criterion{hint}')
        elif not criteria_by_id[self.of].can_measure(self.measure):
            measure_names = criteria_by_id[self.of].measures
            figures = (
                f"one of {join_with_or(measure_names)}{suggest_name(self.measure, measure_names)}"
                if measure_names
                else "one that has figures"
            )
            yield UnmetRequirement(
                "measure",
                f'measure is "{self.measure}", which "{self.of}" ({criteria_by_id[self.of].check}) does not measure, '
                f"expected {figures}",
            )

    @model_validator(mode="after")
    def _check_step_order(self) -> Self:
        for first, second in pairwise(self.steps):
            if (first[0] >= second[0]) != self.highest or first[1] <= second[1]:
                raise TableMistake(
                    "steps", "has steps out of order, expected the best first, each worth less than the one before"
                )
        if not all(0 <= share <= 1 for _, share in self.steps):
            raise TableMistake("steps", "has a share out of range in steps, expected from 0 to 1")
        return self
