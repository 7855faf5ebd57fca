"""The criterion about what the robot draws with straight legs: an L, a square, several squares.

Only what is asked; finding the legs in the path is the service's.
"""

from __future__ import annotations

from typing import ClassVar, Literal, Self

from pydantic import Field, model_validator

from submissions.criteria.common import Criterion, Texts
from submissions.criteria.places import Range


class Drawing(Criterion):
    """Figures of straight legs, drawn one after the other: ``figures`` of ``legs`` legs each, no more, no fewer.

    In each figure every leg has at least ``shortest`` mm, all are equal within ``equal_within`` (a share of
    their mean), and the angles between one leg and the next are ``angle`` degrees within ``angle_within``.
    With ``closes`` the figure ends where it began, to within ``closes_within`` mm or a tenth of a leg,
    whichever is more. ``sizes`` is [least, most] of the mean leg, one for each figure; ``growing`` asks that
    each figure is larger than the one before. ``at_least`` takes more figures than ``figures`` as well.
    ``pen = false`` looks at the whole path, whether the pen was down or not.
    """

    check: Literal["drawing"]
    measures: ClassVar[Texts] = ("legs", "leg #", "corner #", "from start to end")
    legs: int = Field(ge=1)
    figures: int = Field(default=1, ge=1)
    at_least: bool = False
    shortest: float = Field(default=60.0, gt=0)
    equal_within: float = Field(default=0.1, gt=0, le=1)
    angle: float = Field(default=90.0, gt=0, le=180)
    angle_within: float = Field(default=6.0, gt=0, le=90)
    closes: bool = False
    closes_within: float = Field(default=25.0, gt=0)
    sizes: tuple[Range, ...] = ()
    growing: bool = False
    pen: bool = True

    @model_validator(mode="after")
    def _fits(self) -> Self:
        if self.sizes and len(self.sizes) != self.figures:
            raise ValueError(
                f"has {len(self.sizes)} sizes for {self.figures} figures, expected one [least, most] for each figure"
            )
        return self
