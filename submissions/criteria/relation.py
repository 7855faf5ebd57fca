"""The criterion about how one thing in a run goes with another: slower when nearer, faster where it is brighter.

Moves and where they lead are asked in ``motion.py`` and ``path.py``.
"""

from __future__ import annotations

from typing import ClassVar, Literal, Self

from pydantic import Field, model_validator

from submissions.criteria.common import Criterion, Texts

#: What a run has a value of in every tick.
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
    """One series of the recording goes with another, or against it, while the robot moves.

    Any two moments are compared in which both series differ, each by more than a twentieth of its own range: in
    ``at_least`` of these pairs (a share) the moment with the lower ``to`` has the lower ``of`` as well; the higher
    with ``goes = "against"``. ``changes`` is by how much ``of`` must change in all, so that a robot that does the same
    all the time earns nothing. Speeds are mm, or degrees of the wheel, a second, and turning degrees a second, none
    with regard to the direction; light is percent, ultrasonic mm.
    """

    check: Literal["relation"]
    measures: ClassVar[Texts] = ("share of pairs", "least", "most")
    of: Series
    to: Series
    goes: Literal["with", "against"] = "with"
    at_least: float = Field(default=0.9, gt=0.5, le=1)
    changes: float = Field(default=0.0, ge=0)

    @model_validator(mode="after")
    def _two_series(self) -> Self:
        if self.of == self.to:
            raise ValueError("has the same series in of and to, expected two")
        return self
