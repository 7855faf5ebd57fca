"""Criteria about logs: the datalog and the image log.

Programs write them with ``print("Light_left: 42")`` and ``print("image_data both")``, as in the notebooks.
"""

from __future__ import annotations

from itertools import pairwise
from typing import ClassVar, Literal, Self

from pydantic import Field, model_validator

from submissions.criteria.common import Criterion, CriterionWithStrays, Texts
from submissions.criteria.places import Range
from submissions.strict_table import TableMistake

#: Instruments that a series can be a log of.
Instrument = Literal["left light", "right light", "ultrasonic", "gyro", "left wheel", "right wheel"]


class Datalog(CriterionWithStrays):
    """A series of the datalog, selected by name (``Light_left``), meets all given conditions.

    - ``at_least``, ``at_most``: limits on the number of samples.
    - ``plateaus``: values that occur in this order, each for ``plateau_samples`` samples in a row within ``tolerance``.
      Other values may occur between them.
    - ``between``: [least, most] for every sample.
    - ``covers``: a range whose two ends the series must reach.
    - ``measured``: only samples that this instrument read (in any of its units) at most half a second earlier count.
      Each 10 ms of reading time allows one sample, because a program can print any number at any time.
    - ``dips_below``: a series whose lowest sample must be higher than the lowest of this one.
    - ``timed``: every sample has the time, as in ``print("Light_left: 42 " + str(get_clock()))``.
    """

    check: Literal["datalog"]
    measures: ClassVar[Texts] = ("samples", "made up", "least", "most")
    series: str = Field(min_length=1, max_length=40)
    at_least: int = Field(default=1, ge=0)
    at_most: int | None = Field(default=None, ge=0)
    plateaus: tuple[float, ...] = ()
    tolerance: float = Field(default=1.0, ge=0)
    plateau_samples: int = Field(default=2, ge=1)
    between: Range | None = None
    covers: Range | None = None
    dips_below: str | None = Field(default=None, min_length=1)
    timed: bool = False
    measured: Instrument | None = None

    @model_validator(mode="after")
    def _check_options(self) -> Self:
        if self.at_most is not None and self.at_most < self.at_least:
            raise TableMistake("at_least", "has an at_least above its at_most, expected at_least <= at_most")
        if any(abs(one - other) <= self.tolerance for one, other in pairwise(self.plateaus)):
            raise TableMistake(
                "plateaus", "has two plateaus in a row that the tolerance makes one, expected them to differ"
            )
        return self


class ImageLog(Criterion):
    """The images that the program logs with ``image_data left``, ``right`` or ``both``.

    - ``left``, ``right``: the exact number of images of each sensor; ``left_at_least``, ``right_at_least``: the
      minimum.
    - ``at_start``: each image shows the view from the scenario's start pose.
    - ``pairs``: left and right alternate, left first.
    - ``uniform``: a sensor whose images have a single colour, as label patches do, and show a patch if the floor has
      them.
    """

    check: Literal["image_log"]
    measures: ClassVar[Texts] = ("images",)
    left: int | None = Field(default=None, ge=0)
    right: int | None = Field(default=None, ge=0)
    left_at_least: int = Field(default=0, ge=0)
    right_at_least: int = Field(default=0, ge=0)
    at_start: bool = False
    pairs: bool = False
    uniform: Literal["left", "right"] | None = None

    @model_validator(mode="after")
    def _check_options(self) -> Self:
        counts = self.left is not None or self.right is not None or self.left_at_least or self.right_at_least
        if not (counts or self.at_start or self.pairs or self.uniform):
            raise ValueError(
                "has no condition, expected left, right, left_at_least, right_at_least, at_start, pairs or uniform"
            )
        if (self.left is not None and self.left_at_least) or (self.right is not None and self.right_at_least):
            raise ValueError("has a number of images beside at_least, expected one or the other for each sensor")
        return self
