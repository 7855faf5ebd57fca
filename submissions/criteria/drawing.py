"""Criterion about figures with straight legs: an L, a square, several squares.

``service`` finds the legs in the path.
"""

from __future__ import annotations

from typing import Annotated, ClassVar, Literal, Self

from pydantic import Field, model_validator

from submissions.criteria.common import Criterion, Texts
from submissions.criteria.places import Range
from submissions.strict_table import TableMistake

_Legs = Annotated[int, Field(ge=1, le=100)]
_Angle = Annotated[float, Field(gt=0, le=180)]


class Drawing(Criterion):
    """Figures with straight legs, drawn in order: exactly ``figures`` figures of ``legs`` legs each.

    ``legs`` can be a list with the number of legs of each figure, for example [3, 4] for a triangle and a square.
    ``angle`` can then be a list too.

    - ``shortest``: the minimum length of a leg, mm.
    - ``equal_within``: the maximum deviation of a leg from the mean leg of its figure, as a share of the mean.
    - ``angle``, ``angle_within``: the angle between successive legs and its tolerance, degrees.
    - ``closes``: the figure ends at its start, within ``closes_within`` mm or a tenth of a leg, whichever is more.
    - ``sizes``: [least, most] of the mean leg, one for each figure.
    - ``growing``: the legs of each figure are 1 mm longer than those of the previous one, or more.
    - ``at_least``: more figures than ``figures`` are allowed.
    - ``pen = false``: the whole path counts, with the pen up or down.
    """

    check: Literal["drawing"]
    measures: ClassVar[Texts] = ("legs", "leg #", "corner #", "from start to end")
    legs: _Legs | Annotated[tuple[_Legs, ...], Field(min_length=1, max_length=50)]
    figures: int = Field(default=1, ge=1)
    at_least: bool = False
    shortest: float = Field(default=60.0, gt=0)
    equal_within: float = Field(default=0.1, gt=0, le=1)
    angle: _Angle | tuple[_Angle, ...] = 90.0
    angle_within: float = Field(default=6.0, gt=0, le=90)
    closes: bool = False
    closes_within: float = Field(default=25.0, gt=0)
    sizes: tuple[Range, ...] = ()
    growing: bool = False
    pen: bool = True

    @property
    def legs_of_each(self) -> tuple[int, ...]:
        """The number of legs of each figure."""
        return self.legs if isinstance(self.legs, tuple) else (self.legs,) * self.figures

    @property
    def figure_count(self) -> int:
        """The number of figures required."""
        return len(self.legs_of_each)

    @property
    def angle_of_each(self) -> tuple[float, ...]:
        """The angle of each figure in degrees."""
        return self.angle if isinstance(self.angle, tuple) else (self.angle,) * len(self.legs_of_each)

    @model_validator(mode="after")
    def _check_options(self) -> Self:
        if isinstance(self.legs, tuple) and self.figures not in (1, len(self.legs)):
            raise TableMistake(
                "legs", f"has {len(self.legs)} numbers in legs, expected one for each of {self.figures} figures"
            )
        if isinstance(self.angle, tuple) and len(self.angle) != self.figure_count:
            raise TableMistake(
                "angle", f"has {len(self.angle)} numbers in angle, expected one for each of {self.figure_count} figures"
            )
        if self.at_least and isinstance(self.legs, tuple):
            raise TableMistake(
                "at_least", "has at_least beside a list of legs, expected one number of legs for all figures"
            )
        if self.sizes and len(self.sizes) != self.figure_count:
            raise TableMistake(
                "sizes",
                f"has {len(self.sizes)} sizes for {self.figure_count} figures, "
                "expected one [least, most] for each figure",
            )
        return self
