"""Criterion about the floor under a light sensor when the robot stops.

Criteria about the robot's final pose are in ``ending.py``.
"""

from __future__ import annotations

from typing import ClassVar, Literal, Self

from pydantic import Field, model_validator

from submissions.criteria.common import Criterion, Texts
from submissions.criteria.places import Range, Zone


class StopOn(Criterion):
    """The robot stops by itself with a light sensor on the right place. All given conditions must hold.

    - ``reflected``: [least, most] in percent, as ``reflected_light_intensity_pc`` reads it.
    - ``rgb``: a colour; each channel may differ by ``rgb_tolerance``.
    - ``zone``: [left, bottom, right, top] in mm.
    - ``near``: a point; the sensor's maximum distance is ``within`` mm.
    - ``sensor = "either"``: one of the two sensors is enough.
    - ``off_floor``: black outside the floor counts too.
    - ``still``: the time in seconds without motion before the program ends.

    A program that still runs at the time limit has not stopped. A program that ends with an error has.
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
    def _check_options(self) -> Self:
        if self.reflected is None and self.rgb is None and self.zone is None and self.near is None:
            raise ValueError("has no condition, expected reflected, rgb, zone or near")
        return self
