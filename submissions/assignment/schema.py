"""Schemas of the tables in an assignment file, with error messages for invalid tables.

Each table is validated by itself. ``assignment_parts.py`` checks relations between tables, and the files beside them.
"""

from __future__ import annotations

import json
import re
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Annotated, Any, Literal, Self, TypeVar, get_args

from pydantic import (
    BaseModel,
    Discriminator,
    Field,
    Tag,
    ValidationError,
    ValidationInfo,
    field_validator,
    model_validator,
)
from pydantic.fields import FieldInfo
from pydantic_core import ErrorDetails

from sim.floors import HEIGHT, OBSTACLE_PRESETS, WIDTH
from sim.motion import Rectangle
from sim.robot import ROBOTS
from submissions.assignment.limits import DEFAULT_LIMITS
from submissions.strict_table import Entries, StrictTable
from submissions.suggestions import join_with_or, suggest_name
from submissions.sweep import CONDITIONS

T = TypeVar("T", bound=BaseModel)
Levels = Annotated[tuple[float, ...], Field(max_length=100)]
#: Maximum number of mistakes reported per table, because comparing them takes quadratic time.
_MAX_PROBLEMS = 200
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
            raise ValueError(f'has {min(unused_keys)} and no link that it limits, expected link = "infrared" beside it')
        if self.link == "between robots" and self.beacon is not None:
            raise ValueError("has a beacon, but the robots talk to each other, expected no beacon with this link")
        if self.link == "infrared" and self.beacon is None:
            raise ValueError('has link = "infrared" and no beacon, expected beacon = [x, y] beside it')
        if self.beacon is not None and not (0 < self.beacon[0] < WIDTH and 0 < self.beacon[1] < HEIGHT):
            raise ValueError(f"has a beacon off the floor, expected it within {WIDTH} x {HEIGHT} mm")
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


#: Kinds of a value that may be a number or a table. Pydantic adds them to the path of a mistake.
_NUMBER, _TABLE = "(number)", "(table)"


def _choose_kind(value: object) -> str:
    return _TABLE if isinstance(value, dict | BaseModel) else _NUMBER


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
        Annotated[int, Field(ge=1, le=1000), Tag(_NUMBER)] | Annotated[DrawTable, Tag(_TABLE)],
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
            raise ValueError(f"is {_format_short(value)}, expected a number or a list of numbers")
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


@dataclass(frozen=True, slots=True)
class TableProblem:
    """A mistake in a table: its path and a sentence."""

    path: tuple[str | int, ...]
    sentence: str


def read_table(schema: type[T], table: object) -> T | list[TableProblem]:
    """Validate a table with the schema. Return the model, or a list of all mistakes."""
    try:
        # Pydantic's JSON mode is strict about types, but accepts a list for a tuple.
        return schema.model_validate_json(json.dumps(table, default=_encode_foreign_value), strict=True)
    except ValidationError as error:
        errors = error.errors(include_url=False)[:_MAX_PROBLEMS]
        paths = [details["loc"] for details in errors]
        return [describe_problem(schema, details) for details in errors if not _is_consequence(details, paths)]


def _is_consequence(details: ErrorDetails, paths: list[tuple[str | int, ...]]) -> bool:
    """Return whether a list counts as too short only because its entries were rejected."""
    path = details["loc"]
    return details["type"] == "too_short" and any(
        len(other) > len(path) and other[: len(path)] == path for other in paths
    )


def _as_tuples(value: object) -> object:
    return tuple(_as_tuples(item) for item in value) if isinstance(value, list) else value


def _check_range(values: tuple[float, ...], maximum: float, minimum: float = 0) -> tuple[float, ...]:
    for value in values:
        if not minimum <= value <= maximum:
            raise ValueError(f"has {value:g} in it, expected numbers from {minimum:g} to {maximum:g}")
    return values


def _encode_foreign_value(value: object) -> dict[str, str]:
    """Convert dates and times, which no key accepts, to a table that no key accepts either."""
    return {"date": str(value)}


_TYPES: Mapping[str, str] = {
    "string_type": "a text in quotes",
    "float_type": "a number",
    "float_parsing": "a number",
    "decimal_type": "a number",
    "decimal_parsing": "a number",
    "int_type": "a whole number",
    "int_from_float": "a whole number",
    "int_parsing": "a whole number",
    "bool_type": "true or false",
    "bool_parsing": "true or false",
    "tuple_type": "a list",
    "list_type": "a list",
    "dict_type": "a table",
    "model_type": "a table",
    "model_attributes_type": "a table",
    "finite_number": "a finite number",
    "string_too_short": "a text that is not empty",
    "string_pattern_mismatch": "small letters, digits, - and _, beginning with a letter or digit",
}


def describe_problem(schema: type[BaseModel], details: ErrorDetails) -> TableProblem:
    """Convert a pydantic error to a sentence and its path in the table."""
    path = tuple(part for part in details["loc"] if part not in (_NUMBER, _TABLE))
    name = str(path[-1]) if path else ""
    context: Mapping[str, Any] = details.get("ctx", {})
    kind = details["type"]
    if kind == "extra_forbidden":
        return TableProblem(path, _describe_unknown_key(schema, path))
    if kind == "missing":
        if isinstance(path[-1], int):
            sentence = f"{_format_path(path[:-1])} has too few numbers{_describe_entries(schema, path)}"
            return TableProblem(path[:-1], sentence)
        return TableProblem(path[:-1], f"{name} is missing, expected {name} = ...")
    if kind in ("value_error", "assertion_error"):
        sentence = details["msg"].partition(", ")[2]
        return TableProblem(path or _find_key(sentence, details["input"]), f"{_format_path(path)} {sentence}")
    value = _format_short(details["input"])
    if kind in _TYPES:
        return TableProblem(path, f"{_format_path(path)} is {value}, expected {_TYPES[kind]}")
    if kind == "literal_error":
        choices = str(context.get("expected", ""))
        hint = suggest_name(str(details["input"]), re.findall("'(.*?)'", choices))
        choices = choices.replace("'", '"')
        return TableProblem(path, f"{_format_path(path)} is {value}, expected {choices}{hint}")
    bounds = {"greater_than": ("gt", "more than"), "greater_than_equal": ("ge", "at least")}
    bounds |= {"less_than": ("lt", "less than"), "less_than_equal": ("le", "at most")}
    if kind in bounds:
        key, comparison = bounds[kind]
        return TableProblem(path, f"{_format_path(path)} is {value}, expected {comparison} {context[key]:g}")
    if kind == "decimal_max_places":
        return TableProblem(path, f"{_format_path(path)} is {value}, expected at most two decimal places")
    if kind == "too_short":
        return TableProblem(
            path, f"{_format_path(path)} has too few entries, expected at least {context['min_length']}"
        )
    if kind == "too_long":
        return TableProblem(path, f"{_format_path(path)} has too many numbers{_describe_entries(schema, path)}")
    if kind == "string_too_long":
        return TableProblem(
            path, f"{_format_path(path)} is too long, expected at most {context['max_length']} characters"
        )
    return TableProblem(path, f"{_format_path(path)} is {value}, but {details['msg'][:1].lower()}{details['msg'][1:]}")


def _find_key(sentence: str, table: object) -> tuple[str, ...]:
    """Return the key that a sentence about the whole table mentions, to locate its line; empty if it mentions none."""
    words = re.findall(r"\w+", sentence.partition(", expected")[0])
    return tuple([word for word in words if isinstance(table, dict) and word in table][:1])


def _describe_unknown_key(schema: type[BaseModel], path: tuple[str | int, ...]) -> str:
    for part in path[:-1]:
        field = _collect_fields(schema).get(str(part))
        schema = (_find_table_schema(field.annotation) if field else None) or schema
    known_keys = list(_collect_fields(schema))
    name = str(path[-1])
    hint = suggest_name(name, known_keys)
    return f'"{name[:60]}" is not a key of this table, expected {join_with_or(known_keys)}{hint}'


def _find_table_schema(annotation: object) -> type[BaseModel] | None:
    """Return the schema of the tables that a key accepts, single or in a list."""
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        return annotation
    return next((found for part in get_args(annotation) if (found := _find_table_schema(part))), None)


def _format_path(path: tuple[str | int, ...]) -> str:
    """Return the path as text: ``poses[2]``, ``channel.delay``."""
    text = ""
    for part in path:
        text += f"[{part}]" if isinstance(part, int) else f".{part}" if text else part
    return text or "this table"


def _describe_entries(schema: type[BaseModel], path: tuple[str | int, ...]) -> str:
    """Describe the entries of a list of fixed length, from the type of its key."""
    shape = None
    for key in path:
        field = _collect_fields(schema).get(str(key))
        if field is not None:
            shape = next((each for each in field.metadata if isinstance(each, Entries)), None) or _find_entries(
                field.annotation
            )
            schema = _find_table_schema(field.annotation) or schema
    return f", expected {shape.words}" if shape else ", expected another number of them"


def _find_entries(annotation: object) -> Entries | None:
    if isinstance(annotation, Entries):
        return annotation
    return next((found for part in get_args(annotation) if (found := _find_entries(part))), None)


def _collect_fields(schema: type[BaseModel]) -> dict[str, FieldInfo]:
    return {field.alias or name: field for name, field in schema.model_fields.items()}


def _format_short(value: object) -> str:
    if isinstance(value, dict) and value.keys() == _encode_foreign_value("").keys():
        return str(value["date"])
    text = json.dumps(value, default=str, ensure_ascii=False)
    return text if len(text) <= 60 else text[:57] + "..."
