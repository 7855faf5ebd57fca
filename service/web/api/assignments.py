"""API of a course's assignments: add them from the catalogue, upload, preview, open and close them."""

from __future__ import annotations

from datetime import datetime
from typing import Annotated, Any

from fastapi import Depends, Path, Query, Response
from pydantic import BaseModel, Field

from service.operations import assignment_uploads, assignment_views, assignments
from service.operations.assignment_uploads import UploadRequest
from service.operations.types import Role
from service.web.api.shapes import Shape, build_example_config
from service.web.api_access import CallerInCourse, require_role
from service.web.api_routes import After, Limit, Listed, api_router, build_list_page, decode_cursor
from service.web.api_uploads import MAX_ASSIGNMENT_BYTES, ZIP_BODY, UploadedZip
from service.web.context import Context
from service.web.request_bodies import takes_upload
from submissions.assignment.assignment_overview import read_overview
from submissions.assignment.definition import Assignment
from submissions.assignment.examples import locate_catalogue_reference
from submissions.assignment.folder import list_catalogue_ids, locate_assignment_folder
from submissions.assignment.reader import find_in_catalogue

router = api_router("assignments")
ReadAccess = Annotated[CallerInCourse, Depends(require_role(Role.INSTRUCTOR, "read"))]
ManageAccess = Annotated[CallerInCourse, Depends(require_role(Role.INSTRUCTOR, "manage"))]
AssignmentId = Annotated[str, Path(min_length=1, max_length=100)]
_EXAMPLE = {"title": "Shape recognition", "max_marks": 12}
_ASKED_EXAMPLE = {
    "id": "shape-recognition",
    "version": "3f9a1c20",
    "description": "The robot stands over one of six shapes ...",
    "background": "Simple_Shapes",
    "program": "student",
    "responder": "student",
    "given": [],
    "criteria": [
        {"id": "named", "title": "Names the shape", "check": "classification", "marks": 6, "visibility": "visible"}
    ],
    "scenarios": [{"id": "each-shape", "title": "", "seconds": 10, "trials": 12, "visibility": "visible"}],
    "has_reference": True,
    **_EXAMPLE,
}


class CatalogueShape(Shape):
    """An assignment of the catalogue."""

    id: str
    title: str
    section: str = Field(description="Section of the course materials; empty if there is none.")
    topic: str = Field(description="Number of the part that contains the section.")
    sentence: str = Field(description="The task, in one sentence of the description.")
    max_marks: float = Field(validation_alias="marks")
    trials: int

    model_config = build_example_config(
        id="shape-recognition",
        section="08.5 §5.2.1",
        topic="08",
        sentence="Write a program that says the name of the shape.",
        trials=12,
        **_EXAMPLE,
    )


class AssignmentShape(Shape):
    """An assignment of a course, in the version that submissions are graded against."""

    id: str = Field(validation_alias="assignment")
    title: str
    max_marks: float
    version: str
    open: bool
    opened_at: datetime | None
    closed_at: datetime | None
    names_hidden: bool

    model_config = build_example_config(
        id="shape-recognition",
        version="3f9a1c20",
        open=True,
        opened_at="2026-11-02T09:00:00Z",
        closed_at=None,
        names_hidden=False,
        **_EXAMPLE,
    )


class AssignmentBody(BaseModel):
    """The assignment of the catalogue to prepare."""

    assignment: str = Field(min_length=1, max_length=100, examples=["shape-recognition"])


class MarkedLineShape(Shape):
    """A criterion of an assignment."""

    id: str
    title: str
    check: str
    marks: float
    visibility: str


class ScenarioShape(Shape):
    """A scenario: the conditions of one or more trials."""

    id: str
    title: str
    seconds: float = Field(description="Maximum simulated time, in seconds.")
    trials: int
    visibility: str


class AskedShape(Shape):
    """An assignment of the catalogue with its task, including hidden criteria and scenarios."""

    id: str
    title: str
    max_marks: float
    version: str
    description: str
    background: str = Field(description="The floor.")
    program: str = Field(description="Source of the robot program: student, none, or a given file.")
    responder: str
    given: list[str] = Field(description="Files that students receive.")
    criteria: list[MarkedLineShape]
    scenarios: list[ScenarioShape]
    has_reference: bool = Field(description="Whether a reference solution can be graded as a preview.")

    model_config = build_example_config(**_ASKED_EXAMPLE)


class WholeAssignmentShape(AskedShape):
    """An assignment of a course with its task, including hidden criteria and scenarios."""

    open: bool
    opened_at: datetime | None
    closed_at: datetime | None
    names_hidden: bool

    model_config = build_example_config(
        open=True, opened_at="2026-11-02T09:00:00Z", closed_at=None, names_hidden=False, **_ASKED_EXAMPLE
    )


class PreviewShape(Shape):
    """The job that grades a reference solution. It belongs to the token's owner and to no batch."""

    job: str

    model_config = build_example_config(job="7xk2v9q4m0ab")


class NamesBody(BaseModel):
    """Visibility of names during marking."""

    names_hidden: bool


@router.get("/courses/{course_id}/catalogue")
def list_catalogue(
    _access: ReadAccess,
    limit: Limit = 50,
    after: After = "",
    q: Annotated[
        str, Query(max_length=100, description="Words that the description of an assignment must contain.")
    ] = "",
    topic: Annotated[str, Query(max_length=10, description="Number of a part of the course materials.")] = "",
) -> Listed[CatalogueShape]:
    """List the assignments of the catalogue, which every course can use."""
    sort_key = decode_cursor(after, str)
    overviews = (
        read_overview(locate_assignment_folder(each))
        for each in list_catalogue_ids()
        if sort_key is None or each > sort_key[0]
    )
    matching_overviews = [each for each in overviews if each.matches_text(q) and topic in ("", each.topic)][: limit + 1]
    return build_list_page(
        [CatalogueShape.model_validate(each) for each in matching_overviews], limit, lambda each: [each.id]
    )


@router.get("/courses/{course_id}/catalogue/{assignment}")
def one_of_catalogue(_access: ReadAccess, assignment: AssignmentId) -> AskedShape:
    """Return the task of an assignment of the catalogue, as a course would get it."""
    return AskedShape(**_build_assignment_fields(find_in_catalogue(assignment)))


@router.get("/courses/{course_id}/assignments")
def list_assignments(
    access: ReadAccess, context: Context, limit: Limit = 50, after: After = ""
) -> Listed[AssignmentShape]:
    """List the course's prepared and open assignments, by id."""
    sort_key = decode_cursor(after, str)
    course_assignments = assignment_views.list_prepared(context.service, access.actor, access.course_id)
    shapes = [
        AssignmentShape.model_validate(each)
        for each in course_assignments
        if sort_key is None or each.assignment > sort_key[0]
    ]
    return build_list_page(shapes[: limit + 1], limit, lambda each: [each.id])


@router.post("/courses/{course_id}/assignments", status_code=201)
def prepare(access: ManageAccess, context: Context, body: AssignmentBody) -> AssignmentShape:
    """Add an assignment of the catalogue to the course without opening it, or update it to the newest version."""
    assignment = assignment_uploads.prepare_from_catalogue(
        context.service, access.actor, access.course_id, body.assignment
    )
    return AssignmentShape.model_validate(assignment)


@router.post("/courses/{course_id}/assignments/uploads", status_code=201, openapi_extra=ZIP_BODY)
@takes_upload(MAX_ASSIGNMENT_BYTES, Role.INSTRUCTOR)
def upload(
    access: ManageAccess,
    context: Context,
    zip_path: UploadedZip,
    replace: Annotated[bool, Query(description="Replace another assignment that students have already seen.")] = True,
) -> AssignmentShape:
    """Upload an assignment as a zip of its folder; its reference solution is graded as a preview.

    It replaces an assignment with the same ID. If students have seen that one and `replace` is false, the response is
    409.
    """
    assignment = assignment_uploads.upload(
        context.service, access.actor, access.course_id, UploadRequest(zip_path, replace)
    )
    return AssignmentShape.model_validate(assignment)


@router.get("/courses/{course_id}/assignments/{assignment}")
def one_assignment(access: ReadAccess, context: Context, assignment: AssignmentId) -> WholeAssignmentShape:
    """Return the task of an assignment of the course, and whether it is open."""
    line, content = assignment_views.load(context.service, access.actor, access.course_id, assignment)
    return WholeAssignmentShape(
        **_build_assignment_fields(content),
        open=line.open,
        opened_at=line.opened_at,
        closed_at=line.closed_at,
        names_hidden=line.names_hidden,
    )


@router.post("/courses/{course_id}/assignments/{assignment}/preview", status_code=201)
def preview(access: ManageAccess, context: Context, assignment: AssignmentId) -> PreviewShape:
    """Grade the reference solution as a submission of the token's owner. It belongs to no batch."""
    return PreviewShape(job=assignment_uploads.preview(context.service, access.actor, access.course_id, assignment))


@router.post("/courses/{course_id}/assignments/{assignment}/open")
def open_one(access: ManageAccess, context: Context, assignment: AssignmentId) -> AssignmentShape:
    """Open an assignment: students can see it and submit."""
    course_assignment = assignments.open_for_students(context.service, access.actor, access.course_id, assignment)
    return AssignmentShape.model_validate(course_assignment)


@router.post("/courses/{course_id}/assignments/{assignment}/close")
def close_one(access: ManageAccess, context: Context, assignment: AssignmentId) -> AssignmentShape:
    """Close an assignment for new submissions. Existing submissions are kept."""
    course_assignment = assignments.close(context.service, access.actor, access.course_id, assignment)
    return AssignmentShape.model_validate(course_assignment)


@router.delete("/courses/{course_id}/assignments/{assignment}", status_code=204, response_class=Response)
def remove(access: ManageAccess, context: Context, assignment: AssignmentId) -> None:
    """Remove an assignment from the course. This is possible only if students have not seen it."""
    assignments.remove(context.service, access.actor, access.course_id, assignment)


@router.post("/courses/{course_id}/assignments/{assignment}/names")
def hide_names(access: ManageAccess, context: Context, assignment: AssignmentId, body: NamesBody) -> AssignmentShape:
    """Hide or show the students' names during marking."""
    names_hidden = body.names_hidden
    course_assignment = assignments.hide_names(
        context.service, access.actor, access.course_id, assignment, names_hidden=names_hidden
    )
    return AssignmentShape.model_validate(course_assignment)


def _build_assignment_fields(assignment: Assignment) -> dict[str, Any]:
    scenario_ids = [trial.scenario.id for trial in assignment.trials()]
    return {
        "id": assignment.id,
        "title": assignment.title,
        "max_marks": assignment.max_marks,
        "version": assignment.version,
        "description": assignment.description,
        "background": assignment.world.background,
        "program": assignment.parts.program,
        "responder": assignment.parts.responder,
        "given": sorted(assignment.given),
        "criteria": [MarkedLineShape.model_validate(each) for each in assignment.criteria],
        "scenarios": [
            ScenarioShape(
                id=each.id,
                title=each.title,
                seconds=each.seconds,
                trials=scenario_ids.count(each.id),
                visibility=each.visibility,
            )
            for each in assignment.scenarios
        ],
        "has_reference": locate_catalogue_reference(assignment) is not None,
    }
