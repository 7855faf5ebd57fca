"""Criteria about time, and about ranks: how long it took, and what a measured figure is worth.

Whether a program ends at all is asked in ``ending.py``.
"""

from __future__ import annotations

from collections.abc import Iterator
from itertools import pairwise
from typing import Annotated, ClassVar, Literal, Self

from pydantic import Field, model_validator

from submissions.criteria.common import Criterion, Misfit, Surroundings, Texts
from submissions.criteria.places import Range
from submissions.nearest import did_you_mean, listed
from submissions.strict_table import Entries


class Timing(Criterion):
    """How long it took, in seconds of simulated time: from ``between[0]`` to ``between[1]``.

    ``of = "program"`` is from the start to the program's end, ``"moving"`` the time in which the robot moved or
    turned, ``"speech"`` until the last thing that was said had been spoken.
    """

    check: Literal["timing"]
    measures: ClassVar[Texts] = ("time",)
    of: Literal["program", "moving", "speech"] = "program"
    between: Range


class Ranking(Criterion):
    """A figure that another criterion measures is worth marks by steps: the fastest lap gets all of them.

    ``of`` is the id of that criterion and ``measure`` the name of its figure, as reports show it. ``steps``
    are [figure, share]: up to that figure (``highest = true``: from it on) the share of the marks is given.
    A trial in which the other criterion failed is worth nothing. The figure is shown for a table of ranks.
    """

    check: Literal["ranking"]
    of: str = Field(min_length=1, max_length=80)
    measure: str = Field(min_length=1, max_length=60)
    steps: tuple[Annotated[tuple[float, float], Entries("[figure, share]")], ...] = Field(min_length=1)
    highest: bool = False
    over: Literal["share", "all", "mean", "median", "worst"] = "mean"

    @property
    def result_needed(self) -> str:
        """The criterion whose figure is ranked."""
        return self.of

    def misfits(self, around: Surroundings) -> Iterator[Misfit]:
        """The criterion that is ranked has to be there, and to need no other's result itself."""
        # What is itself judged after another is judged too late to be ranked.
        others = {each.id: each for each in around.criteria if each.result_needed is None}
        if self.of not in others:
            hint = did_you_mean(self.of, others)
            yield Misfit("of", f'of is "{self.of[:60]}", expected the id of another criterion{hint}')
        elif not others[self.of].measures_a(self.measure):
            known = others[self.of].measures
            figures = f"one of {listed(known)}{did_you_mean(self.measure, known)}" if known else "one that has figures"
            yield Misfit(
                "measure",
                f'measure is "{self.measure}", which "{self.of}" ({others[self.of].check}) does not measure, '
                f"expected {figures}",
            )

    @model_validator(mode="after")
    def _ordered(self) -> Self:
        for better, worse in pairwise(self.steps):
            if (better[0] >= worse[0]) != self.highest or better[1] <= worse[1]:
                raise ValueError("has steps out of order, expected the best first, each worth less than the one before")
        if not all(0 <= share <= 1 for _, share in self.steps):
            raise ValueError("has a share out of range in steps, expected from 0 to 1")
        return self
