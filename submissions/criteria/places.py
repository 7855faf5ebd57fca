"""Places in an assignment: areas, lines, and the part of the robot that is measured.

Coordinates are mm from the lower left corner of the floor. ``service`` measures distances.
"""

from __future__ import annotations

import itertools
import math
from typing import Annotated, Literal, Self

from pydantic import AfterValidator, Field, field_validator, model_validator

from sim.floors.tracks import load_centrelines
from submissions.strict_table import Entries, StrictTable, TableMistake

#: The measured point: the middle of the axle, the pen's drawing, or a light sensor.
Part = Literal["robot", "pen", "left_light", "right_light"]

Point = Annotated[tuple[float, float], Entries("[x, y]")]


def _check_range(value: tuple[float, float]) -> tuple[float, float]:
    if value[0] > value[1]:
        raise ValueError("is an empty range, expected [least, most]")
    return value


def _check_zone(zone: tuple[float, float, float, float]) -> tuple[float, float, float, float]:
    if not (zone[0] < zone[2] and zone[1] < zone[3]):
        raise ValueError("is empty, expected [left, bottom, right, top]")
    return zone


#: Minimum and maximum, both inclusive. At least one value must fit.
Range = Annotated[tuple[float, float], AfterValidator(_check_range), Entries("[least, most]")]
#: In mm; the area must not be empty.
Zone = Annotated[tuple[float, float, float, float], AfterValidator(_check_zone), Entries("[left, bottom, right, top]")]


class Area(StrictTable):
    """A ``rectangle``, a ``circle``, a ``polygon`` or a ``bar`` with round ends; ``name`` is for the feedback.

    With ``outside``, the area is everything outside the shape.
    """

    name: str = Field(default="", max_length=80)
    rectangle: Annotated[tuple[float, float, float, float], Entries("[left, bottom, right, top]")] | None = None
    circle: Annotated[tuple[float, float, float], Entries("[x, y, radius]")] | None = None
    polygon: tuple[Point, ...] | None = None  # corners
    bar: Annotated[tuple[float, float, float, float, float], Entries("[x1, y1, x2, y2, radius]")] | None = None
    outside: bool = False

    @model_validator(mode="after")
    def _check_one_shape(self) -> Self:
        if sum(shape is not None for shape in (self.rectangle, self.circle, self.polygon, self.bar)) != 1:
            raise ValueError("is not an area, expected one of rectangle, circle, polygon and bar")
        if self.rectangle is not None:
            left, bottom, right, top = self.rectangle
            if not (left < right and bottom < top):
                raise TableMistake("rectangle", "has an empty rectangle, expected [left, bottom, right, top]")
        if self.circle is not None and not self.circle[2] > 0:
            raise TableMistake("circle", "has a circle without a radius, expected [x, y, radius]")
        if self.bar is not None and not self.bar[4] > 0:
            raise TableMistake("bar", "has a bar without a radius, expected [x1, y1, x2, y2, radius]")
        if self.polygon is not None and len(self.polygon) < 3:
            raise TableMistake(
                "polygon", "has a polygon of fewer than three corners, expected [[x, y], [x, y], [x, y], ...]"
            )
        return self


class LineToFollow(StrictTable):
    """A line to drive along, with its direction.

    - ``on``: a line of a floor (``Line_Following_Test/141``, ``Thruxton_Circuit``).
    - ``points``: the corners.
    - ``ellipse``: [x, y, horizontal radius, vertical radius].
    - ``arc``: the part of the ellipse between two angles, in degrees anticlockwise from the right. The arc runs
      clockwise if the second angle is smaller.
    - ``closed``: the end is joined to the beginning. Thruxton's circuit is always closed.
    """

    on: str | None = None
    points: tuple[Point, ...] | None = None
    ellipse: (
        Annotated[tuple[float, float, float, float], Entries("[x, y, horizontal radius, vertical radius]")] | None
    ) = None
    arc: Annotated[tuple[float, float], Entries("[from, to]")] = (0.0, 360.0)
    closed: bool = False
    name: str = Field(default="the line", max_length=80)

    @field_validator("on")
    @classmethod
    def _check_known(cls, value: str | None) -> str | None:
        if value is not None and value not in load_centrelines():
            names = ", ".join(f'"{name}"' for name in load_centrelines())
            raise ValueError(f"names no line of a floor, expected one of {names}")
        return value

    @model_validator(mode="after")
    def _check_one_kind(self) -> Self:
        if sum(kind is not None for kind in (self.on, self.points, self.ellipse)) != 1:
            raise ValueError("is not a line, expected one of on, points and ellipse")
        if not 0 < abs(self.arc[1] - self.arc[0]) <= 360:
            raise TableMistake("arc", "has an arc of no length or of more than 360 degrees, expected arc = [from, to]")
        if self.ellipse is not None and not (self.ellipse[2] > 0 and self.ellipse[3] > 0):
            raise TableMistake(
                "ellipse", "has an ellipse without radii, expected [x, y, horizontal radius, vertical radius]"
            )
        if len(self.corners()) < 2 or self.length() <= 0:
            raise TableMistake("points", "has a line of fewer than two points, expected points = [[x, y], [x, y], ...]")
        return self

    def corners(self) -> tuple[Point, ...]:
        """The corners of the line; a closed line repeats its first corner at the end."""
        if self.on is not None:
            return load_centrelines()[self.on]
        if self.points is not None:
            return (*self.points, self.points[0]) if self.closed else self.points
        x, y, radius_x, radius_y = self.ellipse or (0.0, 0.0, 0.0, 0.0)
        start, end = (math.radians(angle) for angle in self.arc)
        steps = 180
        angles = (start + (end - start) * step / steps for step in range(steps + 1))
        return tuple((x + radius_x * math.cos(angle), y + radius_y * math.sin(angle)) for angle in angles)

    def length(self) -> float:
        """The length along all corners in mm."""
        corners = self.corners()
        return sum(math.dist(before, after) for before, after in itertools.pairwise(corners))

    @property
    def is_closed(self) -> bool:
        """True if the end of the line joins its beginning."""
        return (
            self.closed
            or self.on == "Thruxton_Circuit"
            or (abs(self.arc[1] - self.arc[0]) == 360 and bool(self.ellipse))
        )
