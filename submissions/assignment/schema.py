"""Schemas of the tables in an assignment file.

Each table is validated by itself (``table_problems.py``). ``assignment_parts.py`` checks relations between tables, and
the files beside them.
"""

from __future__ import annotations

from typing import Annotated, Literal, Self

from pydantic import (
    BaseModel,
    Discriminator,
    Field,
    Tag,
    ValidationInfo,
    field_validator,
    model_validator,
)

from sim.floors import HEIGHT, OBSTACLE_PRESETS, WIDTH
from sim.motion import Rectangle
from sim.robot import ROBOTS
from submissions.assignment.limits import DEFAULT_LIMITS
from submissions.assignment.scenario import CONDITIONS
from submissions.assignment.table_problems import NUMBER_TAG, TABLE_TAG, format_short
from submissions.strict_table import Entries, StrictTable, TableMistake
from submissions.suggestions import join_with_or, suggest_name

Levels = Annotated[tuple[float, ...], Field(max_length=100)]
Slug = Field(pattern=r"^[a-z0-9][a-z0-9_-]*$", max_length=80)


class HeadTable(StrictTable):
    """The keys before the first table."""

    id: str = Slug
    title: str = Field(min_length=1, max_length=200)
    section: str = Field(default="", max_length=80)  # of the course: 02.2 §2.2.1
    description: str = Field(default="", max_length=20_000)
    given: tuple[str, ...] = ()
    given_models: dict[str, str] = Field(default_factory=dict)
    aliases: dict[str, tuple[str, ...]] = Field(default_factory=dict)  # of labels, for every classification
    secret: str = Field(default="", max_length=200)  # contributes to the seeds of scenarios that are not visible


class WorldTable(StrictTable):
    """The floor with its objects, and the robot with its physics."""

    background: str = "Empty_Map"
    labels: bool = True
    obstacles: tuple[Annotated[Rectangle, Entries("[x, y, width, height]")], ...] = ()
    robot: str = "Default_Robot"
    robots: Literal[1, 2] = 1
    solid: bool = False
    drive: Literal["course", "wheels"] = "course"
    noise: Literal["course", "both directions"] = "course"
    tick: Literal["thirtieth", "browser"] = "thirtieth"
    sheet: int | str = 0

    @field_validator("sheet", mode="before")
    @classmethod
    def _check_sheet(cls, value: object) -> object:
        if value in ("fixed", "per-seed") or (type(value) is int and 0 <= value < 1 << 63):
            return value
        raise ValueError('is not a digit sheet, expected "fixed", "per-seed" or a whole number from 0')

    @field_validator("obstacles", mode="before")
    @classmethod
    def _expand_preset(cls, value: object) -> object:
        if not isinstance(value, str):
            return _as_tuples(value)
        if value not in OBSTACLE_PRESETS:
            choices = f"{join_with_or(OBSTACLE_PRESETS)} or a list of [x, y, width, height]"
            raise ValueError(f'is "{value[:60]}", expected {choices}{suggest_name(value, OBSTACLE_PRESETS)}')
        return OBSTACLE_PRESETS[value]

    @field_validator("robot")
    @classmethod
    def _check_robot(cls, value: str) -> str:
        if value not in ROBOTS:
            raise ValueError(f'is "{value[:60]}", expected {join_with_or(ROBOTS)}{suggest_name(value, ROBOTS)}')
        return value


class PartsTable(StrictTable):
    """Source of the program and the responder, and the cell of a notebook that has the program."""

    program: str = Field(default="student", min_length=1)
    second_program: str = Field(default="student", min_length=1)
    responder: str = Field(default="student", min_length=1)
    cell: str | int = "last"

    @field_validator("cell", mode="before")
    @classmethod
    def _check_cell(cls, value: object) -> object:
        tag = isinstance(value, str) and value.startswith("tag:") and value.removeprefix("tag:").strip()
        if value == "last" or tag or (type(value) is int and 1 <= value <= 1000):
            return value
        raise ValueError('is not a notebook cell, expected "last", "tag:NAME" or the number of a robot program, from 1')


class ChannelTable(StrictTable):
    """Effects of the channel: delays in seconds, probabilities, and an infrared link in mm."""

    link: Literal["cable", "infrared", "between robots"] = "cable"
    beacon: Annotated[tuple[float, float], Entries("[x, y]")] | None = None
    range: float = Field(default=600.0, gt=0, le=5000)
    facing: float = Field(default=90.0, gt=0, le=360)
    blocked_by: Literal["obstacles", "nothing"] = "obstacles"

    delay: float = Field(default=0.1, ge=0, le=60)
    jitter: float = Field(default=0.0, ge=0, le=60)
    loss: float = Field(default=0.0, ge=0, le=1)
    duplication: float = Field(default=0.0, ge=0, le=1)
    reordering: float = Field(default=0.0, ge=0, le=1)
    corruption: float = Field(default=0.0, ge=0, le=1)

    @model_validator(mode="after")
    def _check_link(self) -> Self:
        unused_keys = self.model_fields_set & {"beacon", "range", "facing", "blocked_by"}
        if self.link == "cable" and unused_keys:
            raise TableMistake(
                min(unused_keys),
                f'has {min(unused_keys)} and no link that it limits, expected link = "infrared" beside it',
            )
        if self.link == "between robots" and self.beacon is not None:
            raise TableMistake(
                "beacon", "has a beacon, but the robots talk to each other, expected no beacon with this link"
            )
        if self.link == "infrared" and self.beacon is None:
            raise TableMistake("link", 'has link = "infrared" and no beacon, expected beacon = [x, y] beside it')
        if self.beacon is not None and not (0 < self.beacon[0] < WIDTH and 0 < self.beacon[1] < HEIGHT):
            raise TableMistake("beacon", f"has a beacon off the floor, expected it within {WIDTH} x {HEIGHT} mm")
        return self


class SweepTable(StrictTable):
    """Lists of levels, one for each varied condition."""

    offset_x: Levels = ()
    offset_y: Levels = ()
    heading: Levels = ()
    light_noise: Levels = ()
    motor_noise: Levels = ()
    loss: Levels = ()
    delay: Levels = ()

    @field_validator("*")
    @classmethod
    def _sort_levels(cls, value: tuple[float, ...], info: ValidationInfo) -> tuple[float, ...]:
        condition = CONDITIONS[str(info.field_name)]
        if len(set(value)) < len(value):
            raise ValueError("has a level twice, expected each once")
        return tuple(sorted(_check_range(value, condition.most, condition.least)))


def _choose_kind(value: object) -> str:
    return TABLE_TAG if isinstance(value, dict | BaseModel) else NUMBER_TAG


class DrawTable(StrictTable):
    """The numbers of trials that are drawn from a pool: at least, and at most before the value is exact."""

    least: int = Field(default=4, ge=1, le=1000)
    most: int = Field(default=40, ge=1, le=1000)


class ScenarioTable(StrictTable):
    """Start poses, conditions and number of trials."""

    id: str = Slug
    title: str = Field(default="", max_length=200)
    poses: tuple[Annotated[tuple[float, float, float], Entries("[x, y, heading]")], ...] = Field(
        default=(), min_length=1
    )
    second_poses: tuple[Annotated[tuple[float, float, float], Entries("[x, y, heading]")], ...] = ()
    choose: Literal["each", "random", "shuffled"] = "each"
    pool: int | None = Field(default=None, ge=2, le=1000)  # the number of trials over which criteria are defined
    trials: Annotated[
        Annotated[int, Field(ge=1, le=1000), Tag(NUMBER_TAG)] | Annotated[DrawTable, Tag(TABLE_TAG)],
        Discriminator(_choose_kind),
    ] = 1
    seconds: float = Field(default=60.0, gt=0, le=3600)
    light_noise: Levels = Field(default=(0.0,), min_length=1)
    motor_noise: Levels = Field(default=(0.0,), min_length=1)
    channel: ChannelTable = ChannelTable()
    start_jitter: Annotated[tuple[float, float, float], Entries("[mm in x, mm in y, degrees]")] = (0.0, 0.0, 0.0)
    sweep: SweepTable = SweepTable()
    visibility: Literal["visible", "hidden", "after_due_date", "after_published"] = "visible"

    @field_validator("poses", "second_poses", mode="before")
    @classmethod
    def _check_poses(cls, value: object) -> object:
        if isinstance(value, list) and value and all(isinstance(entry, int | float) for entry in value):
            raise ValueError("is a single pose, expected a list of them: [[x, y, heading], ...]")
        return _as_tuples(value)

    @field_validator("light_noise", "motor_noise", mode="before")
    @classmethod
    def _as_levels(cls, value: object) -> object:
        if isinstance(value, str | bool):
            raise ValueError(f"is {format_short(value)}, expected a number or a list of numbers")
        return (value,) if isinstance(value, int | float) else _as_tuples(value)

    @field_validator("start_jitter")
    @classmethod
    def _check_jitter(cls, value: tuple[float, float, float]) -> tuple[float, ...]:
        return _check_range(value, 100)

    @field_validator("light_noise")
    @classmethod
    def _check_light_noise(cls, value: tuple[float, ...]) -> tuple[float, ...]:
        return _check_range(value, 128)

    @field_validator("motor_noise")
    @classmethod
    def _check_motor_noise(cls, value: tuple[float, ...]) -> tuple[float, ...]:
        return _check_range(value, 500)


class TrainingTable(StrictTable):
    """Scenarios whose images train a submitted function."""

    scenarios: tuple[str, ...] = Field(min_length=1)
    function: str = Field(default="train", pattern=r"^[A-Za-z_]\w*$", max_length=80)
    image: Literal["focus", "whole"] = "focus"


class RerunsTable(StrictTable):
    """What students learn from reruns of their trials."""

    causes: bool = True
    halves: bool = False
    statements: bool = False
    reveals: int = Field(default=0, ge=0, le=100)


class LimitsTable(StrictTable):
    """Limits for one trial, and for all trials together (``all_``)."""

    program_cpu: float = Field(default=DEFAULT_LIMITS.program_cpu, gt=0, le=120)
    responder_cpu: float = Field(default=DEFAULT_LIMITS.responder_cpu, gt=0, le=120)
    program_memory_mb: int = Field(default=DEFAULT_LIMITS.program_memory_mb, ge=64, le=4096)
    responder_memory_mb: int = Field(default=DEFAULT_LIMITS.responder_memory_mb, ge=64, le=4096)
    output_bytes: int = Field(default=DEFAULT_LIMITS.output_bytes, ge=1000, le=50_000_000)
    all_cpu: float | None = Field(default=DEFAULT_LIMITS.all_cpu, gt=0, le=3600)
    all_sleep: float = Field(default=DEFAULT_LIMITS.all_sleep, ge=1, le=600)
    all_output_mb: int = Field(default=DEFAULT_LIMITS.all_output_mb, ge=1, le=1024)


def _as_tuples(value: object) -> object:
    return tuple(_as_tuples(item) for item in value) if isinstance(value, list) else value


def _check_range(values: tuple[float, ...], maximum: float, minimum: float = 0) -> tuple[float, ...]:
    for value in values:
        if not minimum <= value <= maximum:
            raise ValueError(f"has {value:g} in it, expected numbers from {minimum:g} to {maximum:g}")
    return values
