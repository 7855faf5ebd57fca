"""Criterion about the relation of two series: slower when nearer, faster where it is brighter.

Criteria about moves and places are in ``motion.py`` and ``path.py``.
"""

from __future__ import annotations

from typing import ClassVar, Literal, Self

from pydantic import Field, model_validator

from submissions.criteria.common import Criterion, Texts
from submissions.strict_table import TableMistake

#: Values that a recording has in every tick.
Series = Literal[
    "time",
    "x",
    "y",
    "heading",
    "speed",
    "turning",
    "left wheel speed",
    "right wheel speed",
    "left light",
    "right light",
    "ultrasonic",
    "gyro",
]


class Relation(Criterion):
    """One series of the recording increases with another, or decreases with it, while the robot moves.

    The criterion compares all pairs of moments in which each series differs by more than a twentieth of its range. In
    ``at_least`` of these pairs (a share), the moment with the lower ``to`` must have the lower ``of``; the higher with
    ``goes = "against"``. ``changes`` is the minimum total change of ``of``, so that constant behaviour gets no marks.

    Speeds are mm per second, or wheel degrees per second; turning is in degrees per second. All are absolute values.
    Light is in percent, ultrasonic in mm.
    """

    check: Literal["relation"]
    measures: ClassVar[Texts] = ("share of pairs", "least", "most")
    of: Series
    to: Series
    goes: Literal["with", "against"] = "with"
    at_least: float = Field(default=0.9, gt=0.5, le=1)
    changes: float = Field(default=0.0, ge=0)

    @model_validator(mode="after")
    def _check_two_series(self) -> Self:
        if self.of == self.to:
            raise TableMistake("of", "has the same series in of and to, expected two")
        return self
