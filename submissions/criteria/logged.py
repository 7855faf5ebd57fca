"""Criteria about what a program logs: the datalog and the images.

Logs are what ``print("Light_left: 42")`` and ``print("image_data both")`` leave, as in the notebooks.
"""

from __future__ import annotations

from itertools import pairwise
from typing import ClassVar, Literal, Self

from pydantic import Field, model_validator

from submissions.criteria.common import AmongMany, Criterion, Texts
from submissions.criteria.places import Range

#: What a series may be a log of.
Instrument = Literal["left light", "right light", "ultrasonic", "gyro", "left wheel", "right wheel"]


class Datalog(AmongMany):
    """A series of the datalog, by its name (``Light_left``), has what it should; all that is given must hold.

    ``at_least`` and ``at_most`` count its samples. ``plateaus`` are values that it must keep for
    ``plateau_samples`` samples in a row, within ``tolerance``, in this order; others may lie between.
    ``between`` is [least, most] for every sample; ``covers`` is a range that the series must reach both ends
    of. With ``measured`` only samples count that this instrument read (in any unit of the brick's) at most half a
    second before they were printed, one for each 10 ms that a reading takes: a program may print any number, and any
    number of times. ``dips_below`` names a series whose lowest
    sample must lie above this one's. ``timed`` asks for the time in every sample, as in
    ``print("Light_left: 42 " + str(get_clock()))``.
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
    def _fits(self) -> Self:
        if self.at_most is not None and self.at_most < self.at_least:
            raise ValueError("has an at_least above its at_most, expected at_least <= at_most")
        if any(abs(one - other) <= self.tolerance for one, other in pairwise(self.plateaus)):
            raise ValueError("has two plateaus in a row that the tolerance makes one, expected them to differ")
        return self


class ImageLog(Criterion):
    """The images that the program logs with ``image_data left``, ``right`` or ``both``.

    ``left`` and ``right`` are how many there must be of each sensor, ``left_at_least`` and ``right_at_least`` how many
    or more. ``at_start`` asks that each shows what
    the sensor sees from the pose that the scenario starts at; ``pairs`` that left and right take turns,
    left first; ``uniform`` names the sensor whose images must be of one colour, as a label patch is, and show one
    where the floor has them.
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
    def _fits(self) -> Self:
        counts = self.left is not None or self.right is not None or self.left_at_least or self.right_at_least
        if not (counts or self.at_start or self.pairs or self.uniform):
            raise ValueError(
                "asks for nothing, expected left, right, left_at_least, right_at_least, at_start, pairs or uniform"
            )
        if (self.left is not None and self.left_at_least) or (self.right is not None and self.right_at_least):
            raise ValueError("has a number of images beside at_least, expected one or the other for each sensor")
        return self
