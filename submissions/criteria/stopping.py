"""The criterion about what is under a light sensor when the robot stops.

Where the robot itself ends is ``ending.py``'s.
"""

from __future__ import annotations

from typing import ClassVar, Literal, Self

from pydantic import Field, model_validator

from submissions.criteria.common import Criterion, Texts
from submissions.criteria.places import Range, Zone


class StopOn(Criterion):
    """The robot stops by itself with a light sensor on the right thing; all that is given must hold.

    ``reflected`` is [least, most] in percent, what ``reflected_light_intensity_pc`` reads; ``rgb`` is a
    colour, each part of it met within ``rgb_tolerance``. ``zone`` is [left, bottom, right, top] in mm;
    ``near`` is a point that the sensor is within ``within`` mm of. ``sensor = "either"``: one of the two
    must do. What lies beside the floor is black and does not count, unless with ``off_floor``. ``still`` asks that
    the robot stood for so many seconds before its program ended.

    A program that still runs when its time is over has not stopped. One that stops by an error has.
    """

    check: Literal["stop_on"]
    measures: ClassVar[Texts] = ("end x", "end y", "sensor x", "sensor y", "reading", "time")
    sensor: Literal["left", "right", "either"] = "left"
    reflected: Range | None = None
    rgb: tuple[float, float, float] | None = None
    rgb_tolerance: float = Field(default=10.0, ge=0)
    zone: Zone | None = None
    near: tuple[float, float] | None = None
    within: float = Field(default=50.0, gt=0)
    still: float = Field(default=0.0, ge=0)
    off_floor: bool = False

    @model_validator(mode="after")
    def _fits(self) -> Self:
        if self.reflected is None and self.rgb is None and self.zone is None and self.near is None:
            raise ValueError("asks for nothing, expected reflected, rgb, zone or near")
        return self
