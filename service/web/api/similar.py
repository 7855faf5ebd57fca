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
from service.web.api.shapes import Shape, like
from service.web.api_access import CallerInCourse, in_course
from service.web.api_routes import api_router
from service.web.context import Context

router = api_router("batches")
Reads = Annotated[CallerInCourse, Depends(in_course(Role.INSTRUCTOR, "read"))]


class StretchShape(Shape):
    """Lines of the first one's source, and those of the second one's that are like them; lines count from 1."""

    lines: tuple[int, int]
    other_lines: tuple[int, int]


class AlikeSourcesShape(Shape):
    """Two sources that are alike."""

    files: tuple[str, str]
    shares: tuple[float, float] = Field(
        description="The share of each student's own code that the other student also has."
    )
    stretches: list[StretchShape]


class TrialNameShape(Shape):
    """The trial, by scenario and number."""

    scenario: str
    index: int
    noisy: bool = Field(description="Whether light, motors or the channel had random noise.")


class SameInTrialShape(Shape):
    """A trial in which both did what few others did."""

    trial: TrialNameShape
    aspect: Aspect
    sharing: int = Field(description="Number of students with this behaviour.")
    students: int = Field(description="Number of students with any behaviour in this trial.")


class SimilarPairShape(Shape):
    """Two students whose work is alike."""

    students: tuple[str, str]
    share: float = Field(description="The largest share of a source that is also in the other source.")
    sources: list[AlikeSourcesShape]
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

    model_config = like(assignments=[])


@router.get("/courses/{course_id}/batches/{batch_id}/similar")
def show_similar(here: Reads, context: Context, batch_id: RowName) -> SimilaritiesShape:
    """Pairs of students of the course whose newest submissions are alike: a reason to look and to ask, and no proof."""
    found = list_similar(context.service, here.acting, here.course_id, batch_id)
    return SimilaritiesShape(assignments=[SimilarityShape.model_validate(each) for each in found])
