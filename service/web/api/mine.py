"""A student's own: what is open, submitting, and what came of it, as far as they may see it now."""

from __future__ import annotations

from datetime import datetime
from typing import Annotated

from fastapi import Depends, Query, Request
from fastapi.responses import Response
from pydantic import Field
from sqlalchemy import Select, select
from sqlalchemy.orm import Session

from service.report_files import report_alone
from service.reports.view import View, student_view
from service.store import batches, open_assignments, policies, results
from service.store.batches import JobLine
from service.store.models import Job, SubmissionRow
from service.store.states import JobState, Role, Standing
from service.web.access import RowNumber, enrolment_in, nothing_here, own_submission
from service.web.api.grades import HTML, REPLAY, ZIP, grade_answer, packed_answer, replay_answer
from service.web.api.people import LimitsShape
from service.web.api.shapes import GradeShape, Shape, example_of, like
from service.web.api_access import CallerInCourse, in_course
from service.web.api_routes import After, Limit, Listed, api_router, page_of, place_after, tagged
from service.web.api_uploads import SENT_BODY, Sent
from service.web.context import Context, WebContext
from service.web.submitting import submit

router = api_router("mine")
Reads = Annotated[CallerInCourse, Depends(in_course(Role.STUDENT, "read"))]
Submits = Annotated[CallerInCourse, Depends(in_course(Role.STUDENT, "submit"))]
PREFIX = "/courses/{course_id}/mine"


class OpenShape(Shape):
    """An assignment that students may see."""

    id: str
    title: str
    max_marks: float
    open: bool = Field(description="Whether it may be submitted to.")
    limits: LimitsShape = Field(description="What holds for the token's owner.")

    model_config = like(
        id="shape-recognition",
        title="Shape recognition",
        max_marks=12,
        open=True,
        limits=example_of(LimitsShape),
    )


class SubmissionShape(Shape):
    """One submission of the token's owner, and how far it is."""

    id: int
    assignment: str
    attempt: int
    source: str = Field(description="The name that it came under.")
    submitted_at: datetime
    days_late: int
    over: str | None = Field(description="The limit that it was over: staff see it, and it counts by their leave.")
    job: str | None
    state: JobState | None
    progress: float = Field(description="Of the grading, from 0 to 1.")
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
        published=False,
    )


@router.get(PREFIX + "/assignments")
def list_open(here: Reads, context: Context, limit: Limit = 50, after: After = "") -> Listed[OpenShape]:
    """What the course shows its students, by id."""
    place = place_after(after, str)
    with context.store.reading() as session:
        enrolment = enrolment_in(session, here.caller.identity, here.course_id)
        shown = [
            OpenShape(
                id=each.assignment,
                title=each.title,
                max_marks=float(each.max_marks),
                open=each.open,
                limits=LimitsShape.model_validate(policies.limits(session, enrolment.id, each.assignment)),
            )
            for each in open_assignments.of_course(session, here.course_id)
            if each.opened_at is not None and (place is None or each.assignment > place[0])
        ]
    return page_of(shown[: limit + 1], limit, lambda each: [each.id])


@router.post(PREFIX + "/submissions", status_code=201, openapi_extra=SENT_BODY)
def submit_one(
    here: Submits,
    context: Context,
    sent: Sent,
    assignment: Annotated[str, Query(min_length=1, max_length=100, examples=["shape-recognition"])],
) -> SubmissionShape:
    """Submit: a robot program, a responder, a notebook, or a zip with them; each a part `files` of the form."""
    identity = here.caller.identity
    accepted = submit(context, identity, here.course_id, assignment, sent)
    with context.store.reading() as session:
        submission_id = session.get_one(Job, accepted.job_id).submission_id
        return _shown(session, own_submission(session, identity, here.course_id, submission_id))


@router.get(PREFIX + "/submissions")
def list_submissions(here: Reads, context: Context, limit: Limit = 50, after: After = "") -> Listed[SubmissionShape]:
    """What the token's owner submitted in the course, the newest first."""
    place = place_after(after, int)
    with context.store.reading() as session:
        enrolment = enrolment_in(session, here.caller.identity, here.course_id)
        query = select(SubmissionRow).where(SubmissionRow.enrolment_id == enrolment.id)
        if place is not None:
            query = query.where(SubmissionRow.id < place[0])
        rows = session.scalars(query.order_by(SubmissionRow.id.desc()).limit(limit + 1)).all()
        return page_of([_shown(session, row) for row in rows], limit, lambda each: [each.id])


@router.get(PREFIX + "/submissions/{submission_id}")
def one_submission(here: Reads, context: Context, submission_id: RowNumber) -> SubmissionShape:
    """One submission, and how far it is."""
    with context.store.reading() as session:
        return _shown(session, own_submission(session, here.caller.identity, here.course_id, submission_id))


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


def _standing(submission_id: int) -> Select[Job]:
    """The grading that counts."""
    return select(Job).where(Job.submission_id == submission_id, Job.standing == Standing.STANDS).limit(1)


def _shown(session: Session, row: SubmissionRow) -> SubmissionShape:
    job = session.scalar(_standing(row.id))
    return SubmissionShape(
        id=row.id,
        assignment=row.assignment,
        attempt=row.attempt,
        source=row.source,
        submitted_at=row.submitted_at or row.created_at,
        days_late=row.days_late,
        over=row.staff_only,
        job=None if job is None else job.id,
        state=None if job is None else job.state,
        progress=0.0 if job is None else job.progress,
        published=job is not None and job.published_at is not None,
    )


def _view(context: WebContext, here: CallerInCourse, submission_id: int) -> tuple[JobLine, View]:
    with context.store.reading() as session:
        row = own_submission(session, here.caller.identity, here.course_id, submission_id)
        job = session.scalar(_standing(row.id))
        if job is None or job.state is not JobState.DONE or job.suspect is not None or row.staff_only is not None:
            raise nothing_here()
        view = student_view(results.load(session, job.id), policies.released(session, job.id))
        return batches.job_line(session, job.id), view
