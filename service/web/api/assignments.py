"""What a course has for its students: assignments taken from the catalogue, opened and closed."""

from __future__ import annotations

from datetime import datetime
from typing import Annotated

from fastapi import Depends, Path
from pydantic import BaseModel, Field

from service.store import audit, open_assignments
from service.store.states import Role
from service.store.versions import freeze
from service.web.api.shapes import Shape, like
from service.web.api_access import CallerInCourse, in_course
from service.web.api_routes import After, Limit, Listed, api_router, page_of, place_after
from service.web.context import Context
from submissions.assignment.folder import assignment_folder, catalogue
from submissions.assignment.overview import overview
from submissions.assignment.reader import find_in_catalogue

router = api_router("assignments")
Reads = Annotated[CallerInCourse, Depends(in_course(Role.INSTRUCTOR, "read"))]
Manages = Annotated[CallerInCourse, Depends(in_course(Role.INSTRUCTOR, "manage"))]
AssignmentId = Annotated[str, Path(min_length=1, max_length=100)]
_EXAMPLE = {"title": "Shape recognition", "max_marks": 12}


class CatalogueShape(Shape):
    """An assignment of the catalogue."""

    id: str
    title: str
    section: str
    max_marks: float = Field(validation_alias="marks")
    trials: int

    model_config = like(id="shape-recognition", section="Recognition", trials=36, **_EXAMPLE)


class AssignmentShape(Shape):
    """An assignment of a course, in the version that submissions are marked against."""

    id: str = Field(validation_alias="assignment")
    title: str
    max_marks: float
    version: str
    open: bool
    opened_at: datetime | None
    closed_at: datetime | None
    names_hidden: bool

    model_config = like(
        id="shape-recognition",
        version="3f9a1c20",
        open=True,
        opened_at="2026-11-02T09:00:00Z",
        closed_at=None,
        names_hidden=False,
        **_EXAMPLE,
    )


class AssignmentAsked(BaseModel):
    """Which assignment of the catalogue to prepare."""

    assignment: str = Field(min_length=1, max_length=100, examples=["shape-recognition"])


class NamesAsked(BaseModel):
    """Whether whoever marks sees whose work it is."""

    names_hidden: bool


@router.get("/courses/{course_id}/catalogue")
def list_catalogue(_here: Reads, limit: Limit = 50, after: After = "") -> Listed[CatalogueShape]:
    """The assignments that come with Robomark, of which a course can have any."""
    place = place_after(after, str)
    ids = sorted(each for each in catalogue() if place is None or each > place[0])[: limit + 1]
    found = page_of(ids, limit, lambda each: [each])
    shown = [CatalogueShape.model_validate(overview(assignment_folder(each))) for each in found.items]
    return Listed(items=shown, next=found.next)


@router.get("/courses/{course_id}/assignments")
def list_assignments(here: Reads, context: Context, limit: Limit = 50, after: After = "") -> Listed[AssignmentShape]:
    """What the course has prepared and opened, by id."""
    place = place_after(after, str)
    with context.store.reading() as session:
        found = open_assignments.of_course(session, here.course_id)
    left = [AssignmentShape.model_validate(each) for each in found if place is None or each.assignment > place[0]]
    return page_of(left[: limit + 1], limit, lambda each: [each.id])


@router.post("/courses/{course_id}/assignments", status_code=201)
def prepare(here: Manages, context: Context, asked: AssignmentAsked) -> AssignmentShape:
    """Take an assignment from the catalogue, not yet open; again, to mark by its newest version from now on."""
    frozen = freeze(find_in_catalogue(asked.assignment))
    with context.store.transaction() as session:
        made = open_assignments.prepare(session, here.course_id, frozen)
        audit.note(session, here.actor, "prepare", "course", str(here.course_id), assignment=asked.assignment)
        return AssignmentShape.model_validate(made)


@router.post("/courses/{course_id}/assignments/{assignment}/open")
def open_one(here: Manages, context: Context, assignment: AssignmentId) -> AssignmentShape:
    """Let students see it and submit to it."""
    with context.store.transaction() as session:
        open_assignments.open_for_students(session, here.course_id, assignment)
        audit.note(session, here.actor, "open", "course", str(here.course_id), assignment=assignment)
        return AssignmentShape.model_validate(open_assignments.find(session, here.course_id, assignment))


@router.post("/courses/{course_id}/assignments/{assignment}/close")
def close_one(here: Manages, context: Context, assignment: AssignmentId) -> AssignmentShape:
    """Let nobody submit to it any more; what was submitted stays."""
    with context.store.transaction() as session:
        open_assignments.close(session, here.course_id, assignment)
        audit.note(session, here.actor, "close", "course", str(here.course_id), assignment=assignment)
        return AssignmentShape.model_validate(open_assignments.find(session, here.course_id, assignment))


@router.post("/courses/{course_id}/assignments/{assignment}/names")
def hide_names(here: Manages, context: Context, assignment: AssignmentId, asked: NamesAsked) -> AssignmentShape:
    """Hide or show whose work it is."""
    with context.store.transaction() as session:
        open_assignments.hide_names(session, here.course_id, assignment, asked.names_hidden)
        hidden = {"assignment": assignment, "hidden": asked.names_hidden}
        audit.note(session, here.actor, "names", "course", str(here.course_id), **hidden)
        return AssignmentShape.model_validate(open_assignments.find(session, here.course_id, assignment))
