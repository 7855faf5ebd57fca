"""A student's own: what is open, submitting, and what came of it, as far as they may see it now."""

from __future__ import annotations

from dataclasses import fields
from datetime import datetime
from typing import Annotated

from fastapi import Depends, Path, Query, Request
from fastapi.responses import Response
from pydantic import Field
from sqlalchemy.orm import Session

from service import own_work
from service.own_work import OwnSubmission
from service.report_files import report_alone
from service.reports.view import View, student_view
from service.store.batches import batches
from service.store.batches.batches import JobLine
from service.store.courses import open_assignments, policies
from service.store.grades import results
from service.store.queue.queue_places import queue_place
from service.store.states import JobState, Role
from service.web.access import RowNumber, enrolment_in, nothing_here, own_submission
from service.web.api.grades import HTML, REPLAY, ZIP, grade_answer, packed_answer, replay_answer
from service.web.api.people import LimitsShape
from service.web.api.shapes import GradeShape, Shape, example_of, like
from service.web.api_access import CallerInCourse, in_course
from service.web.api_routes import After, Described, Limit, Listed, api_router, page_of, place_after, tagged
from service.web.api_uploads import SENT_BODY, Sent
from service.web.attachments import attachment
from service.web.context import Context, WebContext
from service.web.submitting import seen_assignment, submit
from submissions.assignment.task_sheet import TaskSheet, task_sheet

router = api_router("mine")
Reads = Annotated[CallerInCourse, Depends(in_course(Role.STUDENT, "read"))]
Submits = Annotated[CallerInCourse, Depends(in_course(Role.STUDENT, "submit"))]
AssignmentId = Annotated[str, Path(min_length=1, max_length=100)]
PREFIX = "/courses/{course_id}/mine"
GIVEN: Described = {
    200: {
        "content": {"application/octet-stream": {"schema": {"type": "string", "format": "binary"}}},
        "description": "The file.",
    }
}


class OpenShape(Shape):
    """An assignment that students may see."""

    id: str
    title: str
    max_marks: float
    open: bool = Field(description="Whether it may be submitted to.")
    limits: LimitsShape = Field(description="What holds for the token's owner.")
    attempts_left: int | None = Field(description="Null where there is no limit.")
    days_left: int = Field(description="Until the due date, the last one counted; 0 where there is none.")

    model_config = like(
        id="shape-recognition",
        title="Shape recognition",
        max_marks=12,
        open=True,
        limits=example_of(LimitsShape),
        attempts_left=4,
        days_left=3,
    )


class PlaceShape(Shape):
    """How many come before a submission, and how long it is to its marks; null where nothing tells how long."""

    before: int
    seconds: float | None
    workers: int = Field(description="That live.")


class SubmissionShape(Shape):
    """One submission of the token's owner, and how far it is."""

    id: int
    assignment: str
    attempt: int
    source: str = Field(description="The name that it came under.")
    submitted_at: datetime
    days_late: int
    over: str | None = Field(
        validation_alias="staff_only",
        description="The limit that it was over: staff see it, and it counts by their leave.",
    )
    job: str = Field(validation_alias="job_id")
    state: JobState
    progress: float = Field(description="Of the grading, from 0 to 1.")
    place: PlaceShape | None = Field(description="In the queue; null once nothing is to come.", default=None)
    marks: float | None = Field(description="As far as they may be seen now; null while there are none.")
    max_marks: float | None
    published: bool = Field(description="Whether the grade is released; until then it may lack what is kept back.")

    model_config = like(
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
    )


class CriterionAskedShape(Shape):
    """One marked line that students see beforehand."""

    title: str
    marks: float


class TaskSheetShape(Shape):
    """What an assignment asks of students; `more_marks` are for what is marked and not told."""

    id: str
    title: str
    section: str
    description: str
    asked: list[str] = Field(description="Files, by name.")
    notebook: bool = Field(description="Whether one notebook will do for all that is asked.")
    criteria: list[CriterionAskedShape]
    max_marks: float
    more_marks: float
    background: str = Field(description="The floor.")
    seconds: float | None = Field(description="Simulated, of the longest trial that is shown.")
    given: list[str] = Field(description="Files that are given.")

    model_config = like(
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
def list_open(here: Reads, context: Context, limit: Limit = 50, after: After = "") -> Listed[OpenShape]:
    """What the course shows its students, by id."""
    place = place_after(after, str)
    with context.store.reading() as session:
        enrolment = enrolment_in(session, here.caller.identity, here.course_id)
        shown = []
        for each in open_assignments.of_course(session, here.course_id):
            if each.opened_at is not None and (place is None or each.assignment > place[0]):
                left = own_work.allowance(session, enrolment.id, each.assignment)
                shown.append(
                    OpenShape(
                        id=each.assignment,
                        title=each.title,
                        max_marks=float(each.max_marks),
                        open=each.open,
                        limits=LimitsShape.model_validate(left.limits),
                        attempts_left=left.attempts_left,
                        days_left=left.days_left,
                    )
                )
    return page_of(shown[: limit + 1], limit, lambda each: [each.id])


@router.get(PREFIX + "/assignments/{assignment}")
def one_assignment(here: Reads, context: Context, assignment: AssignmentId) -> TaskSheetShape:
    """What an assignment asks for, of those that were opened or that the token's owner has submitted to."""
    sheet = _sheet(context, here, assignment)
    criteria = [CriterionAskedShape(title=title, marks=float(marks)) for title, marks in sheet.criteria]
    told = {field.name: getattr(sheet, field.name) for field in fields(sheet)}
    return TaskSheetShape.model_validate(told | {"criteria": criteria, "given": sorted(sheet.given)})


@router.get(PREFIX + "/assignments/{assignment}/given/{file}", responses=GIVEN, response_class=Response)
def given_file(here: Reads, context: Context, assignment: AssignmentId, file: str) -> Response:
    """A file that the assignment gives its students."""
    sheet = _sheet(context, here, assignment)
    if file not in sheet.given:
        raise nothing_here()
    return attachment(sheet.given[file], file)


@router.post(PREFIX + "/submissions", status_code=201, openapi_extra=SENT_BODY)
def submit_one(
    here: Submits,
    context: Context,
    sent: Sent,
    assignment: Annotated[str, Query(min_length=1, max_length=100, examples=["shape-recognition"])],
) -> SubmissionShape:
    """Submit: a robot program, a responder, a notebook, or a zip with them; each a part `files` of the form."""
    identity = here.caller.identity
    accepted = submit(context, identity, here.course_id, assignment, sent, even_in_part=True)
    with context.store.reading() as session:
        return _shown(session, _own(session, here, accepted.submission_id))


@router.get(PREFIX + "/submissions")
def list_submissions(here: Reads, context: Context, limit: Limit = 50, after: After = "") -> Listed[SubmissionShape]:
    """What the token's owner submitted in the course, the newest first."""
    place = place_after(after, int)
    with context.store.reading() as session:
        enrolment = enrolment_in(session, here.caller.identity, here.course_id)
        found = own_work.own_submissions_before(session, enrolment.id, place[0] if place else None, limit + 1)
        return page_of([_shown(session, each) for each in found], limit, lambda each: [each.id])


@router.get(PREFIX + "/submissions/{submission_id}")
def one_submission(here: Reads, context: Context, submission_id: RowNumber) -> SubmissionShape:
    """One submission, and how far it is."""
    with context.store.reading() as session:
        return _shown(session, _own(session, here, submission_id))


@router.get(PREFIX + "/submissions/{submission_id}/grade", response_model=GradeShape)
def grade(request: Request, here: Reads, context: Context, submission_id: RowNumber) -> Response:
    """The grade, as far as its student may see it now; 404 until there is one."""
    line, view = _view(context, here, submission_id)
    return grade_answer(request, line.id, view)


@router.get(PREFIX + "/submissions/{submission_id}/report", responses=HTML, response_class=Response)
def report(request: Request, here: Reads, context: Context, submission_id: RowNumber) -> Response:
    """The report, as far as its student may see it now."""
    line, view = _view(context, here, submission_id)
    return tagged(request, report_alone(context.store, line, view).encode(), "text/html; charset=utf-8")


@router.get(PREFIX + "/submissions/{submission_id}/replay", responses=REPLAY, response_class=Response)
def replay(request: Request, here: Reads, context: Context, submission_id: RowNumber) -> Response:
    """What a replay plays of the trials that the student may see now."""
    line, view = _view(context, here, submission_id)
    return replay_answer(request, context, line.id, view)


@router.get(PREFIX + "/submissions/{submission_id}/files", responses=ZIP, response_class=Response)
def files(here: Reads, context: Context, submission_id: RowNumber) -> Response:
    """What was submitted, as a zip that can be submitted again."""
    with context.store.reading() as session:
        return packed_answer(session, own_submission(session, here.caller.identity, here.course_id, submission_id))


def _own(session: Session, here: CallerInCourse, submission_id: int) -> OwnSubmission:
    enrolment = enrolment_in(session, here.caller.identity, here.course_id)
    found = own_work.own_submission(session, enrolment.id, submission_id)
    if found is None:
        raise nothing_here()
    return found


def _shown(session: Session, found: OwnSubmission) -> SubmissionShape:
    shape = SubmissionShape.model_validate(found)
    place = PlaceShape.model_validate(queue_place(session, found.job_id)) if found.waits else None
    return shape.model_copy(update={"over": found.staff_only or None, "place": place})


def _sheet(context: WebContext, here: CallerInCourse, assignment: str) -> TaskSheet:
    with context.store.reading() as session:
        return task_sheet(seen_assignment(session, here.caller.identity, here.course_id, assignment))


def _view(context: WebContext, here: CallerInCourse, submission_id: int) -> tuple[JobLine, View]:
    with context.store.reading() as session:
        found = _own(session, here, submission_id)
        if not found.shown:
            raise nothing_here()
        view = student_view(results.load(session, found.job_id), policies.released(session, found.job_id))
        return batches.job_line(session, found.job_id), view
