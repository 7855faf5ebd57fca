"""API of similar submissions in a batch, for instructors of the course.

``service.similarity`` compares the submissions. Similarity is no proof, and it never changes marks.
"""

from __future__ import annotations

from typing import Annotated

from fastapi import Depends
from pydantic import Field

from service.operations.similarity import list_similar
from service.operations.types import Role
from service.similarity.behaviour import Aspect
from service.web.access import RowName
from service.web.api.shapes import Shape, build_example_config
from service.web.api_access import CallerInCourse, require_role
from service.web.api_routes import api_router
from service.web.context import Context

router = api_router("batches")
ReadAccess = Annotated[CallerInCourse, Depends(require_role(Role.INSTRUCTOR, "read"))]


class StretchShape(Shape):
    """Similar lines of two sources, as [first line, last line] of each. Line numbers start at 1."""

    lines: tuple[int, int]
    other_lines: tuple[int, int]


class SimilarSourcesShape(Shape):
    """Two similar sources."""

    files: tuple[str, str]
    shares: tuple[float, float] = Field(
        description="Fraction of each student's own code that the other student also has, from 0 to 1."
    )
    stretches: list[StretchShape]


class TrialNameShape(Shape):
    """A trial, identified by scenario and index."""

    scenario: str
    index: int
    noisy: bool = Field(description="Whether light, motors or the channel had random noise.")


class SameInTrialShape(Shape):
    """A trial in which both students show the same rare behaviour."""

    trial: TrialNameShape
    aspect: Aspect
    sharing: int = Field(description="Number of students with this behaviour.")
    students: int = Field(description="Number of students with any behaviour in this trial.")


class SimilarPairShape(Shape):
    """Two students with similar submissions."""

    students: tuple[str, str]
    share: float = Field(description="Largest fraction of a source that is also in the other source, from 0 to 1.")
    sources: list[SimilarSourcesShape]
    trials: list[SameInTrialShape]


class SimilarityShape(Shape):
    """The similar submissions of one assignment, the most similar pair first."""

    assignment: str
    students: int
    pairs: list[SimilarPairShape]
    too_short: list[str] = Field(description="Students with too little own code to compare.")
    same: list[list[str]] = Field(description="Groups of any size with a whole file in common.")
    same_recordings: list[list[str]] = Field(description="Groups whose recordings of all trials are the same.")
    not_compared: int = Field(description="Number of pairs that were not compared because there were too many.")


class SimilaritiesShape(Shape):
    """The similar submissions, by assignment."""

    assignments: list[SimilarityShape]

    model_config = build_example_config(assignments=[])


@router.get("/courses/{course_id}/batches/{batch_id}/similar")
def show_similar(access: ReadAccess, context: Context, batch_id: RowName) -> SimilaritiesShape:
    """List the pairs of students with similar newest submissions. Similarity is a reason for a review, not a proof."""
    similarities = list_similar(context.service, access.actor, access.course_id, batch_id)
    return SimilaritiesShape(assignments=[SimilarityShape.model_validate(each) for each in similarities])
