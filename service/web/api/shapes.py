"""Models of API responses that several subjects share. Their values come from the store's objects.

The other modules define the models that only one subject uses.
"""

from __future__ import annotations

from collections.abc import Mapping
from datetime import datetime
from types import MappingProxyType
from typing import Any

from pydantic import BaseModel, ConfigDict, Field

from service.operations.types import BatchState, JobState, Role, Standing


class Shape(BaseModel):
    """Base of the models. They are read from objects whose attributes have the same names."""

    model_config = ConfigDict(from_attributes=True)


def build_example_config(**example: Any) -> ConfigDict:
    """Return the configuration of a model with an example."""
    return ConfigDict(from_attributes=True, json_schema_extra={"examples": [example]})


BATCH_EXAMPLE: Mapping[str, Any] = MappingProxyType(
    {
        "id": "0c5w1r8zt3ye",
        "name": "week one",
        "state": "open",
        "created_at": "2026-11-02T09:00:00Z",
        "jobs": 20,
        "states": {"done": 18, "running": 2},
        "refusals": [{"source": "bob", "sentence": "bob: holds no robot program.", "assignment": "shape-recognition"}],
        "regrade_of": None,
        "web_assignment": None,
        "takes_in": False,
    }
)


def find_example(shape: type[Shape]) -> Any:
    """Return the example of a model."""
    schema_extra: Any = shape.model_config["json_schema_extra"]
    return schema_extra["examples"][0]


class CourseShape(Shape):
    """A course, with the role of the token's owner."""

    id: int
    name: str
    role: Role

    model_config = build_example_config(id=1, name="TM129", role="instructor")


class RefusalShape(Shape):
    """A rejected submission of a batch, and the reason."""

    source: str = Field(description="Name of the submitted file or folder.")
    sentence: str
    assignment: str = ""


class JobShape(Shape):
    """A grading job of one submission."""

    id: str
    student: str = Field(description="ID in the course; a number if names are hidden.")
    name: str
    source: str = Field(description="Name of the submitted file or folder.")
    assignment: str
    state: JobState
    standing: Standing = Field(
        description="`stands`: current grade; `proposed`: unpublished regrade; `kept`: replaced grade."
    )
    verdict: str | None
    marks: float | None
    max_marks: float
    attempt: int = Field(description="Number of the student's attempt at this assignment.")
    error: str | None
    queued_at: datetime
    finished_at: datetime | None
    published_at: datetime | None
    days_late: int
    staff_only: str | None = Field(
        description="The limit that the submission exceeds; null if none. The grade is hidden from students."
    )
    suspect: str | None = Field(description="Reason for doubt about the grade; null if there is none.")
    missing: str = Field(description="The required part that was not submitted; empty if there is none.")
    copied_from: str | None = Field(
        description="ID of the job whose grade was copied for an identical submission; null otherwise."
    )
    unjudged: int = Field(description="Number of criteria that could not be judged and need review.")
    provisional: bool = Field(description="Whether the marks depend on a pool of which not all trials were run.")

    model_config = build_example_config(
        id="7xk2v9q4m0ab",
        student="ada",
        name="Ada Lovelace",
        source="ada.zip",
        assignment="shape-recognition",
        state="done",
        standing="stands",
        verdict="finished",
        marks=10,
        max_marks=12,
        attempt=1,
        error=None,
        queued_at="2026-11-02T09:00:00Z",
        finished_at="2026-11-02T09:00:04Z",
        published_at=None,
        days_late=0,
        staff_only=None,
        suspect=None,
        missing="",
        copied_from=None,
        unjudged=0,
        provisional=False,
    )


class BatchShape(Shape):
    """A batch, with the number of jobs in each state."""

    id: str
    name: str
    state: BatchState
    created_at: datetime
    jobs: int
    states: dict[JobState, int]
    refusals: list[RefusalShape]
    regrade_of: str | None = Field(description="The batch that was graded again; null if this is not a regrade.")
    web_assignment: str | None = Field(description="The assignment, for a batch of web submissions; null otherwise.")
    takes_in: bool = Field(description="Whether the assignment is open for more submissions.")

    model_config = build_example_config(**BATCH_EXAMPLE)


class CriterionShape(Shape):
    """Marks and message of one criterion."""

    id: str
    title: str
    marks: float
    max_marks: float
    message: str
    for_staff: str = Field(description="Notes for staff about parts that need review.", default="")
    set_by_hand: dict[str, Any] | None = Field(
        description="Adjustment by staff, with the reason; null if there is none.", default=None
    )


class TrialShape(Shape):
    """A trial: one run of the simulation."""

    scenario: str
    seed: int
    verdict: str
    sha256: str = Field(description="Hash of the recording; the same submission gives the same hash.")
    spoken: list[str]
    messages: list[dict[str, Any]]
    partner: dict[str, Any] | None = Field(
        description="The same data for the second robot; null if there is none.", default=None
    )
    notes: list[str]

    model_config = ConfigDict(extra="allow")


class AccuracyShape(Shape):
    """Fraction of correctly recognised items, with a 95% confidence interval."""

    value: float
    low: float
    high: float
    n: int


class GradeShape(Shape):
    """A grade, in the format of `robomark show --json`. Hidden parts are omitted for students."""

    job: str
    schema_: int = Field(alias="schema")
    assignment: str
    marks: float
    max_marks: float
    verdict: str
    cause: str = Field(description="The main reason for lost marks, in a sentence.", default="")
    next_step: str = Field(description="What to do next, in a sentence.", default="")
    hints: list[str] = []
    criteria: list[CriterionShape]
    trials: list[TrialShape]
    accuracy: AccuracyShape | None
    notes: list[str]
    comments: list[dict[str, Any]] = Field(description="Comments by instructors.", default=[])
    missing: str = ""
    cost: dict[str, Any] | None = None
    withheld: bool = Field(description="Whether parts of the grade are hidden from the token's owner.")

    model_config = ConfigDict(
        json_schema_extra={
            "examples": [
                {
                    "job": "7xk2v9q4m0ab",
                    "schema": 1,
                    "assignment": "shape-recognition",
                    "marks": 10,
                    "max_marks": 12,
                    "verdict": "finished",
                    "cause": "In trial 2, the shape was identified as another one.",
                    "next_step": "Compare the images of both shapes.",
                    "criteria": [
                        {
                            "id": "named",
                            "title": "Names the shapes",
                            "marks": 4,
                            "max_marks": 6,
                            "message": "4 of 6 shapes were named.",
                        }
                    ],
                    "trials": [],
                    "accuracy": {"value": 0.67, "low": 0.3, "high": 0.9, "n": 6},
                    "notes": [],
                    "withheld": False,
                }
            ]
        }
    )
