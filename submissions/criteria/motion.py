"""Criteria about motion: the whole run, single moves, excursions, and reactions to a sensor.

Criteria about places on the floor are in ``path.py`` and ``line.py``.
"""

from __future__ import annotations

from typing import ClassVar, Literal, Self

from pydantic import Field, field_validator, model_validator

from submissions.criteria.common import Criterion, Texts
from submissions.criteria.places import Range
from submissions.strict_table import StrictTable


class MotionConditions(StrictTable):
    """Conditions on a move. Each is [least, most]; all given conditions must hold.

    ``forward`` and ``sideways`` (to the left) are the displacement in mm in the frame of the robot's pose at the
    beginning. ``distance`` is the straight-line distance in mm. ``turn`` is the change of heading in degrees
    anticlockwise, ``turn_size`` its absolute value. ``seconds`` is the duration of the motion.
    """

    forward: Range | None = None
    sideways: Range | None = None
    distance: Range | None = None
    turn: Range | None = None
    turn_size: Range | None = None
    seconds: Range | None = None

    @property
    def has_motion_conditions(self) -> bool:
        """Return whether any condition is given."""
        conditions = (self.forward, self.sideways, self.distance, self.turn, self.turn_size, self.seconds)
        return any(value is not None for value in conditions)


class NamedMotion(MotionConditions):
    """A move in a list of moves; feedback uses its ``name``."""

    name: str = Field(default="", max_length=80)

    @model_validator(mode="after")
    def _check_has_condition(self) -> Self:
        if not self.has_motion_conditions:
            raise ValueError(
                "has no condition, expected one of forward, sideways, distance, turn, turn_size and seconds"
            )
        return self


class Displacement(MotionConditions, Criterion):
    """Displacement of the whole run: the end pose relative to the start pose.

    In addition to the conditions on a move, ``left_wheel`` and ``right_wheel`` are [least, most] of the final wheel
    positions in degrees. ``agrees_with_wheels`` is the maximum relative difference between ``distance`` and the travel
    of the left wheel.
    """

    check: Literal["displacement"]
    measures: ClassVar[Texts] = (
        "displacement",
        "displacement forward",
        "displacement sideways",
        "heading change",
        "left wheel",
        "right wheel",
    )
    left_wheel: Range | None = None
    right_wheel: Range | None = None
    agrees_with_wheels: float | None = Field(default=None, gt=0, le=1)

    @model_validator(mode="after")
    def _check_has_condition(self) -> Self:
        wheels = (self.left_wheel, self.right_wheel, self.agrees_with_wheels)
        if not self.has_motion_conditions and all(value is None for value in wheels):
            raise ValueError(
                "has no condition, expected one of forward, sideways, distance, turn, turn_size, seconds, left_wheel, "
                "right_wheel and agrees_with_wheels"
            )
        return self


class Moves(Criterion):
    """The moves of a run.

    A move ends when the robot stops or when the type of motion changes: forwards, backwards, left turn, right turn.
    ``moves`` lists the required moves in order (``in_order = false``: in any order). ``only`` forbids other moves.
    """

    check: Literal["moves"]
    measures: ClassVar[Texts] = (
        "move # forward",
        "move # sideways",
        "move # distance",
        "move # turn",
        "move # seconds",
    )
    moves: tuple[NamedMotion, ...] = Field(min_length=1)
    in_order: bool = True
    only: bool = False


class Excursions(Criterion):
    """Excursions out and back along the robot's start direction.

    ``heights`` are the relative lengths of the excursions (``[1, 2, 1]``), within the relative ``tolerance``. The first
    must be at least ``at_least`` mm long. Each must return to within ``returns_within`` mm of the start, and the run
    must end there. The number of excursions must be exact.
    """

    check: Literal["excursions"]
    measures: ClassVar[Texts] = ("peak #", "return #")
    heights: tuple[float, ...] = Field(min_length=1)
    tolerance: float = Field(default=0.1, gt=0, lt=1)
    at_least: float = Field(default=50.0, gt=0)
    returns_within: float = Field(default=15.0, gt=0)

    @field_validator("heights")
    @classmethod
    def _check_positive(cls, value: tuple[float, ...]) -> tuple[float, ...]:
        if any(height <= 0 for height in value):
            raise ValueError("has a height that is not above 0, expected proportions like [1, 2, 1]")
        return value


class Encounters(Criterion):
    """Reactions of the robot each time a light sensor sees something dark.

    An encounter begins when the reading of ``light`` falls below ``below`` (reflected light, percent) on the floor. The
    reaction consists of the actions in ``then``, in this order, within ``seconds``: ``reverse`` (5 mm backwards),
    ``turn`` (by 15 degrees), ``stop`` (no motion for 0.1 s). ``at_least`` encounters must have the reaction.
    """

    check: Literal["encounters"]
    measures: ClassVar[Texts] = ("encounters", "answered")
    light: Literal["left", "right", "either"] = "left"
    below: float = Field(gt=0, le=100)
    then: tuple[Literal["reverse", "turn", "stop"], ...] = ("reverse", "turn")
    seconds: float = Field(default=3.0, gt=0)
    at_least: int = Field(default=1, ge=1)
