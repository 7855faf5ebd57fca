"""Requests of a notebook as plain JSON data, and the simulator's page as data and back.

A notebook keeps the page between two magics, so everything here comes from outside and is validated strictly.
"""

from __future__ import annotations

from functools import cache
from typing import Annotated, Any, Literal, Self

from pydantic import AfterValidator, BaseModel, ConfigDict, Field, ValidationError, model_validator

from responders.notebook_executor import MagicCall
from service.grading.notebook_runs import LoadedProgram, NotebookPage
from sim.errors import UsageError
from sim.floors import OBSTACLE_PRESETS, get_floor_start, list_floor_names
from sim.recording import Pose
from sim.robot import WIDENED
from submissions.magics import Flags
from submissions.simulator_page import MAX_ANGLE, MAX_LIGHT_NOISE, MAX_MOTOR_NOISE, PageState
from submissions.source_text import MAX_SOURCE_BYTES, Preamble

_MAX_CELL = 100_000
_MAX_ARGUMENTS_LENGTH = 4000
#: A robot can leave the floor, but in the longest run not by more.
_MAX_COORDINATE, _MAX_HEADING = 1e7, 1e9
#: JavaScript's largest whole number.
_MAX_SEED = 2**53 - 1


def _replace_surrogates(text: str) -> str:
    """Return the text without lone surrogates, which files and databases reject."""
    return text.encode("utf-8", "replace").decode("utf-8")


CleanText = Annotated[str, AfterValidator(_replace_surrogates)]
_Number = Annotated[float, Field(ge=-_MAX_COORDINATE, le=_MAX_COORDINATE)]
_CellNumber = Annotated[int, Field(ge=0, le=_MAX_CELL)]
_Source = Annotated[CleanText, Field(max_length=MAX_SOURCE_BYTES)]


class StrictData(BaseModel):
    """Frozen data from outside: no unknown keys, no conversions, no infinite numbers."""

    model_config = ConfigDict(frozen=True, extra="forbid", strict=True, allow_inf_nan=False)

    @classmethod
    def read(cls, data: Any) -> Self:
        """Return the validated data. Raises UsageError with the first mistake."""
        try:
            return cls.model_validate(data)
        except ValidationError as error:
            first = error.errors(include_url=False, include_context=False, include_input=False)[0]
            place = ".".join(str(part)[:40] for part in first["loc"]) or "the whole"
            raise UsageError(
                "the notebook's request is not valid (%(place)s: %(problem)s); restart the kernel and run the cell "
                "that sets up the simulator again",
                place=place,
                problem=first["msg"].removeprefix("Value error, ")[:200],
            ) from None


class ProgramData(StrictData):
    """The loaded robot program, with the lines of its cell."""

    cell: _CellNumber
    text: _Source
    preamble: Literal["none", "imports", "preloaded"]


class PageData(StrictData):
    """The simulator's page and the loaded program, as ``NotebookPage``."""

    version: Literal[1]
    background: Annotated[str, Field(max_length=100)]
    robot: Annotated[str, Field(max_length=100)]
    chosen_robot: Annotated[str, Field(max_length=100)]
    obstacles: Annotated[list[list[_Number]], Field(max_length=100)]
    x: _Number
    y: _Number
    heading: Annotated[float, Field(ge=-_MAX_HEADING, le=_MAX_HEADING)]
    angle_slider: Annotated[int, Field(ge=0, le=MAX_ANGLE)]
    light_noise: Annotated[float, Field(ge=0, le=MAX_LIGHT_NOISE)]
    motor_noise: Annotated[float, Field(ge=0, le=MAX_MOTOR_NOISE)]
    noise_is_heard: bool
    program: ProgramData | None

    @model_validator(mode="after")
    def _check_names(self) -> Self:
        if self.background not in list_floor_names():
            raise ValueError("there is no such background")
        if self.chosen_robot not in WIDENED or self.robot not in (self.chosen_robot, WIDENED[self.chosen_robot]):
            raise ValueError("there is no such robot")
        if tuple(map(tuple, self.obstacles)) not in _list_obstacle_sets():
            raise ValueError("there are no such obstacles")
        return self

    def to_page(self) -> NotebookPage:
        """Return the page."""
        state = PageState(
            background=self.background,
            robot=self.robot,
            chosen_robot=self.chosen_robot,
            obstacles=tuple((x, y, width, height) for x, y, width, height in self.obstacles),
            pose=Pose(self.x, self.y, self.heading),
            angle_slider=self.angle_slider,
            light_noise=self.light_noise,
            motor_noise=self.motor_noise,
            noise_is_heard=self.noise_is_heard,
        )
        program = self.program
        loaded = None if program is None else LoadedProgram(program.cell, program.text, Flags(program.preamble))
        return NotebookPage(state, loaded)


class MagicRequest(StrictData):
    """A magic that a cell has called; ``page`` is the simulator before it, None for a new one."""

    cell: Annotated[int, Field(ge=1, le=_MAX_CELL)]
    name: Annotated[CleanText, Field(max_length=100)]
    arguments: Annotated[CleanText, Field(max_length=_MAX_ARGUMENTS_LENGTH)]
    body: _Source | None
    page: PageData | None
    seed: Annotated[int, Field(ge=0, le=_MAX_SEED)]

    @property
    def call(self) -> MagicCall:
        """Return the call. The magic is in the first line of its cell."""
        return MagicCall(self.cell, 1, self.name, self.arguments, self.body)


@cache
def _list_obstacle_sets() -> frozenset[tuple[Any, ...]]:
    floors = (get_floor_start(name)[1] for name in list_floor_names())
    return frozenset((*OBSTACLE_PRESETS.values(), *floors))


def page_to_json(page: NotebookPage) -> dict[str, Any]:
    """Return a page as data that ``PageData`` accepts."""
    state, program = page.state, page.program
    preamble: Preamble = "preloaded" if program is None else program.flags.preamble
    return {
        "version": 1,
        "background": state.background,
        "robot": state.robot,
        "chosen_robot": state.chosen_robot,
        "obstacles": [list(each) for each in state.obstacles],
        "x": state.pose.x,
        "y": state.pose.y,
        "heading": state.pose.heading,
        "angle_slider": state.angle_slider,
        "light_noise": state.light_noise,
        "motor_noise": state.motor_noise,
        "noise_is_heard": state.noise_is_heard,
        "program": None if program is None else {"cell": program.cell, "text": program.text, "preamble": preamble},
    }
