"""API for students: open assignments, submitting, and the visible parts of their own results."""

from __future__ import annotations

from dataclasses import fields
from datetime import datetime
from typing import Annotated

from fastapi import Depends, Path, Query, Request
from fastapi.responses import Response
from pydantic import Field

from service.operations import own_views
from service.operations.own_changes import ChangeReason
from service.operations.own_views import SubmissionView
from service.operations.submissions import SubmissionRequest
from service.operations.types import JobState, Role
from service.web.access import RowNumber
from service.web.api.grades import (
    HTML_RESPONSES,
    REPLAY_RESPONSES,
    ZIP_RESPONSES,
    respond_with_grade,
    respond_with_replay,
    respond_with_report,
)
from service.web.api.people import LimitsShape
from service.web.api.shapes import GradeShape, Shape, build_example_config, find_example
from service.web.api_access import CallerInCourse, require_role
from service.web.api_routes import (
    After,
    Limit,
    Listed,
    ResponseDescriptions,
    api_router,
    build_list_page,
    decode_cursor,
)
from service.web.api_uploads import MAX_SUBMISSION_BYTES, SENT_BODY, SentFiles
from service.web.attachments import respond_with_attachment
from service.web.context import Context
from service.web.language import detect_language
from service.web.request_bodies import takes_upload
from service.web.student_submissions import submit

router = api_router("mine")
ReadAccess = Annotated[CallerInCourse, Depends(require_role(Role.STUDENT, "read"))]
SubmitAccess = Annotated[CallerInCourse, Depends(require_role(Role.STUDENT, "submit"))]
AssignmentId = Annotated[str, Path(min_length=1, max_length=100)]
PREFIX = "/courses/{course_id}/mine"
GIVEN_RESPONSES: ResponseDescriptions = {
    200: {
        "content": {"application/octet-stream": {"schema": {"type": "string", "format": "binary"}}},
        "description": "The file.",
    }
}


class OpenShape(Shape):
    """An assignment that students can see, with the limits for the token's owner."""

    id: str
    title: str
    max_marks: float
    open: bool = Field(description="Whether students can submit to it.")
    limits: LimitsShape = Field(description="Limits for the token's owner.")
    attempts_left: int | None = Field(description="Null if there is no limit.")
    days_left: int = Field(description="Days until the deadline, including the last day; 0 without a deadline.")

    model_config = build_example_config(
        id="shape-recognition",
        title="Shape recognition",
        max_marks=12,
        open=True,
        limits=find_example(LimitsShape),
        attempts_left=4,
        days_left=3,
    )


class PlaceShape(Shape):
    """Position of a submission in the queue.

    Number of jobs ahead, and estimated seconds until its marks (null if unknown).
    """

    before: int
    seconds: float | None
    workers: int = Field(description="Number of active workers.")


class MarksChangeShape(Shape):
    """The visible marks before a published grade was replaced."""

    marks: float
    max_marks: float
    changed_at: datetime
    reason: ChangeReason = Field(
        description="What changed: `assignment`, its version; `pool`, all trials were run; `grader`, its release; "
        "`again`, none of these."
    )

    model_config = build_example_config(marks=3, max_marks=6, changed_at="2026-11-23T10:00:00Z", reason="assignment")


class SubmissionShape(Shape):
    """A submission of the token's owner, with its grading state."""

    id: int
    assignment: str
    attempt: int
    source: str = Field(description="Name of the submitted file or folder.")
    submitted_at: datetime
    days_late: int
    over: str | None = Field(
        validation_alias="staff_only",
        description="The exceeded limit; null if none. Only staff see the grade, and they decide if it counts.",
    )
    job: str = Field(validation_alias="job_id")
    state: JobState
    progress: float = Field(description="Grading progress from 0 to 1, estimated from the usual duration.", default=1.0)
    place: PlaceShape | None = Field(description="Position in the queue; null if no grade is pending.", default=None)
    marks: float | None = Field(description="The visible part of the marks; null if there are none.")
    max_marks: float | None
    published: bool = Field(description="Whether the grade is published; until then, parts of it can be hidden.")
    withheld: bool = Field(description="Whether the grade becomes visible when it is released.")
    change: MarksChangeShape | None = Field(description="The last change of published marks; null without one.")

    model_config = build_example_config(
        id=3,
        assignment="shape-recognition",
        attempt=1,
        source="robot.py, responder.py",
        submitted_at="2026-11-02T09:00:00Z",
        days_late=0,
        over=None,
        job="7xk2v9q4m0ab",
        state="running",
        progress=0.4,
        place={"before": 0, "seconds": 2.5, "workers": 1},
        marks=None,
        max_marks=None,
        published=False,
        withheld=False,
        change=None,
    )


class CriterionAskedShape(Shape):
    """A criterion that students can see before they submit."""

    title: str
    marks: float


class TaskSheetShape(Shape):
    """The task of an assignment, for students; `more_marks` are the marks of hidden criteria."""

    id: str
    title: str
    section: str
    description: str
    asked: list[str] = Field(description="Required files by name.")
    notebook: bool = Field(description="Whether one notebook can replace all files.")
    criteria: list[CriterionAskedShape]
    max_marks: float
    more_marks: float
    background: str = Field(description="The floor.")
    seconds: float | None = Field(description="Simulated seconds of the longest visible trial; null without one.")
    given: list[str] = Field(description="Files that students receive.")

    model_config = build_example_config(
        id="shape-recognition",
        title="Shape recognition",
        section="08.5 §5.2.1",
        description="The robot stands over one of six shapes ...",
        asked=["robot.py", "responder.py"],
        notebook=True,
        criteria=[{"title": "Names the shape", "marks": 6}],
        max_marks=6,
        more_marks=6,
        background="Simple_Shapes",
        seconds=10,
        given=[],
    )


@router.get(PREFIX + "/assignments")
def list_open(access: ReadAccess, context: Context, limit: Limit = 50, after: After = "") -> Listed[OpenShape]:
    """List the assignments that the course shows to students, by id."""
    sort_key = decode_cursor(after, str)
    opened_assignments = own_views.list_opened(
        context.service,
        access.actor,
        access.course_id,
        limit=limit + 1,
        last_assignment=sort_key[0] if sort_key else "",
    )
    shapes = [
        OpenShape(
            id=each.assignment,
            title=each.title,
            max_marks=float(each.max_marks),
            open=each.open,
            limits=LimitsShape.model_validate(left.limits),
            attempts_left=left.attempts_left,
            days_left=left.days_left,
        )
        for each, left in opened_assignments
    ]
    return build_list_page(shapes, limit, lambda each: [each.id])


@router.get(PREFIX + "/assignments/{assignment}")
def one_assignment(access: ReadAccess, context: Context, assignment: AssignmentId) -> TaskSheetShape:
    """Return the task of an assignment that is open or has a submission of the token's owner."""
    sheet = own_views.show_sheet(context.service, access.actor, access.course_id, assignment)
    criteria = [CriterionAskedShape(title=title, marks=float(marks)) for title, marks in sheet.criteria]
    sheet_fields = {field.name: getattr(sheet, field.name) for field in fields(sheet)}
    return TaskSheetShape.model_validate(sheet_fields | {"criteria": criteria, "given": sorted(sheet.given)})


@router.get(PREFIX + "/assignments/{assignment}/given/{file}", responses=GIVEN_RESPONSES, response_class=Response)
def given_file(access: ReadAccess, context: Context, assignment: AssignmentId, file: str) -> Response:
    """Return a file that students receive with the assignment."""
    return respond_with_attachment(
        own_views.show_given_file(context.service, access.actor, access.course_id, assignment, file), file
    )


@router.post(PREFIX + "/submissions", status_code=201, openapi_extra=SENT_BODY)
@takes_upload(MAX_SUBMISSION_BYTES, Role.STUDENT)
def submit_one(
    access: SubmitAccess,
    context: Context,
    uploaded_files: SentFiles,
    assignment: Annotated[str, Query(min_length=1, max_length=100, examples=["shape-recognition"])],
) -> SubmissionShape:
    """Submit a robot program, a responder, a notebook, or a zip with them. Send each file as a form part `files`."""
    accepted_submission = submit(
        context, access.actor, access.course_id, SubmissionRequest(assignment, uploaded_files, even_in_part=True)
    )
    return _to_submission_shape(
        own_views.show_submission(context.service, access.actor, access.course_id, accepted_submission.submission_id)
    )


@router.get(PREFIX + "/submissions")
def list_submissions(
    access: ReadAccess, context: Context, limit: Limit = 50, after: After = ""
) -> Listed[SubmissionShape]:
    """List the submissions of the token's owner in the course, newest first."""
    sort_key = decode_cursor(after, int)
    views = own_views.list_submissions(
        context.service, access.actor, access.course_id, limit=limit + 1, before_id=sort_key[0] if sort_key else None
    )
    return build_list_page([_to_submission_shape(each) for each in views], limit, lambda each: [each.id])


@router.get(PREFIX + "/submissions/{submission_id}")
def one_submission(access: ReadAccess, context: Context, submission_id: RowNumber) -> SubmissionShape:
    """Return a submission and its grading state."""
    return _to_submission_shape(
        own_views.show_submission(context.service, access.actor, access.course_id, submission_id)
    )


@router.get(PREFIX + "/submissions/{submission_id}/grade", response_model=GradeShape)
def grade(request: Request, access: ReadAccess, context: Context, submission_id: RowNumber) -> Response:
    """Return the parts of the grade that the student can see now; 404 if there is no grade yet."""
    job_id, view = own_views.show_result(context.service, access.actor, access.course_id, submission_id)
    return respond_with_grade(request, job_id, view)


@router.get(PREFIX + "/submissions/{submission_id}/report", responses=HTML_RESPONSES, response_class=Response)
def report(request: Request, access: ReadAccess, context: Context, submission_id: RowNumber) -> Response:
    """Return the parts of the report that the student can see now, in the language of `Accept-Language`."""
    submission_key = (context.service, access.actor, access.course_id, submission_id)
    return respond_with_report(request, own_views.show_report(*submission_key, detect_language(request)))


@router.get(PREFIX + "/submissions/{submission_id}/replay", responses=REPLAY_RESPONSES, response_class=Response)
def replay(request: Request, access: ReadAccess, context: Context, submission_id: RowNumber) -> Response:
    """Return the replay data of the trials that the student can see now."""
    return respond_with_replay(
        request, own_views.show_replay(context.service, access.actor, access.course_id, submission_id)
    )


@router.get(PREFIX + "/submissions/{submission_id}/files", responses=ZIP_RESPONSES, response_class=Response)
def files(access: ReadAccess, context: Context, submission_id: RowNumber) -> Response:
    """Return the submitted files, as a zip that can be submitted again."""
    context.limits.files.spend(str(access.actor.person_id))
    archive = own_views.show_files(context.service, access.actor, access.course_id, submission_id)
    return respond_with_attachment(archive.data, archive.name, "application/zip")


def _to_submission_shape(view: SubmissionView) -> SubmissionShape:
    shape = SubmissionShape.model_validate(view.submission)
    queue_place = None if view.place is None else PlaceShape.model_validate(view.place)
    progress = 1.0 if view.place is None else view.place.progress
    return shape.model_copy(
        update={"over": view.submission.staff_only or None, "place": queue_place, "progress": progress}
    )
