"""Criteria about how the robot moves: as a whole, move by move, there and back, and after what a sensor saw.

Only what is asked; where on the floor it goes is asked in ``path.py`` and ``line.py``.
"""

from __future__ import annotations

from typing import ClassVar, Literal, Self

from pydantic import Field, field_validator, model_validator

from submissions.criteria.common import Criterion, Texts
from submissions.criteria.places import Range
from submissions.strict_table import StrictTable


class AskedMotion(StrictTable):
    """What a move can be asked to be. Each is [least, most]; all that are given must hold.

    ``forward`` and ``sideways`` (to the left) are how far the robot gets, seen from where and how it stood
    at the beginning, ``distance`` is how far it is from there as the crow flies, mm; ``turn`` is by how much
    its heading changes, degrees anticlockwise, ``turn_size`` the same without regard to the direction;
    ``seconds`` is how long it moves.
    """

    forward: Range | None = None
    sideways: Range | None = None
    distance: Range | None = None
    turn: Range | None = None
    turn_size: Range | None = None
    seconds: Range | None = None

    @property
    def asks(self) -> bool:
        """Whether any range is given."""
        given = (self.forward, self.sideways, self.distance, self.turn, self.turn_size, self.seconds)
        return any(value is not None for value in given)


class NamedMotion(AskedMotion):
    """A move in a list of moves; ``name`` is what the feedback calls it."""

    name: str = Field(default="", max_length=80)

    @model_validator(mode="after")
    def _asks_something(self) -> Self:
        if not self.asks:
            raise ValueError(
                "asks for nothing, expected one of forward, sideways, distance, turn, turn_size and seconds"
            )
        return self


class Displacement(AskedMotion, Criterion):
    """What came of the whole run: where the end is, seen from the start.

    Beside what a move can be asked: ``left_wheel`` and ``right_wheel`` are [least, most] of the wheels'
    positions at the end, degrees; ``agrees_with_wheels`` is how far, as a share, ``distance`` may be from
    what the left wheel's position says.
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
    def _asks_something(self) -> Self:
        wheels = (self.left_wheel, self.right_wheel, self.agrees_with_wheels)
        if not self.asks and all(value is None for value in wheels):
            raise ValueError(
                "asks for nothing, expected one of forward, sideways, distance, turn, turn_size, seconds, left_wheel, "
                "right_wheel and agrees_with_wheels"
            )
        return self


class Moves(Criterion):
    """The run move by move.

    A move ends where the robot stands still, or where two ways of moving meet: straight on, straight back, turning
    left, turning right.
    ``moves`` lists what must be among them, in that order (``in_order = false``: in any order);
    ``only`` allows no others.
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
    """Going out and coming back, along the direction in which the robot stood at the start.

    ``heights`` are how far it goes out each time, in proportion (``[1, 2, 1]``), within ``tolerance`` as a
    share; the first is at least ``at_least`` mm. Each time it must come back to within ``returns_within`` mm
    of the start, and it must end there. There must be neither more nor fewer.
    """

    check: Literal["excursions"]
    measures: ClassVar[Texts] = ("peak #", "return #")
    heights: tuple[float, ...] = Field(min_length=1)
    tolerance: float = Field(default=0.1, gt=0, lt=1)
    at_least: float = Field(default=50.0, gt=0)
    returns_within: float = Field(default=15.0, gt=0)

    @field_validator("heights")
    @classmethod
    def _positive(cls, value: tuple[float, ...]) -> tuple[float, ...]:
        if any(height <= 0 for height in value):
            raise ValueError("has a height that is not above 0, expected proportions like [1, 2, 1]")
        return value


class Encounters(Criterion):
    """What the robot does each time a light sensor sees something dark.

    An encounter is when the reading of ``light`` falls below ``below`` (reflected light, percent) on the floor. It is
    answered when what ``then`` lists follows in that order within ``seconds``: ``reverse`` (5 mm backwards),
    ``turn`` (by 15 degrees), ``stop`` (standing still for 0.1 s). ``at_least`` of them must be answered.
    """

    check: Literal["encounters"]
    measures: ClassVar[Texts] = ("encounters", "answered")
    light: Literal["left", "right", "either"] = "left"
    below: float = Field(gt=0, le=100)
    then: tuple[Literal["reverse", "turn", "stop"], ...] = ("reverse", "turn")
    seconds: float = Field(default=3.0, gt=0)
    at_least: int = Field(default=1, ge=1)
