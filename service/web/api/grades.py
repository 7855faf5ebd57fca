"""One grade as staff see it: as data, as the report, and what its replay plays; and its submission."""

from __future__ import annotations

import json
from dataclasses import replace
from typing import Annotated

from fastapi import Depends, Request
from fastapi.responses import Response
from sqlalchemy.orm import Session

from service.plotting import own_floors
from service.report_files import report_alone
from service.reports.formats.json_output import json_document
from service.reports.replay.document import replay_of_grade
from service.reports.view import View, staff_view
from service.store.batches import batches, intake
from service.store.batches.batches import JobLine
from service.store.courses import open_assignments
from service.store.courses.hidden_names import hidden_names_of
from service.store.grades import results
from service.store.models import SubmissionRow
from service.store.states import JobState, Role
from service.web.access import RowName, RowNumber, job_in, nothing_here, submission_in
from service.web.api.shapes import GradeShape, JobShape
from service.web.api_access import CallerInCourse, in_course
from service.web.api_routes import Described, api_router, tagged
from service.web.context import Context, WebContext

router = api_router("grades")
Reads = Annotated[CallerInCourse, Depends(in_course(Role.INSTRUCTOR, "read"))]
HTML: Described = {200: {"content": {"text/html": {"schema": {"type": "string"}}}, "description": "A page of its own."}}
ZIP: Described = {
    200: {"content": {"application/zip": {"schema": {"type": "string", "format": "binary"}}}, "description": "A zip."}
}
REPLAY: Described = {
    200: {
        "content": {"application/json": {"schema": {"type": "object"}}},
        "description": "What `robomark show --replay` writes: floors, sources, trials.",
    }
}


@router.get("/courses/{course_id}/grades/{job_id}/state")
def state(here: Reads, context: Context, job_id: RowName) -> JobShape:
    """How far one grading is."""
    hidden = hidden_names_of(context.store, here.course_id)
    with context.store.reading() as session:
        job_in(session, here.course_id, job_id)
        return JobShape.model_validate(batches.job_line(session, job_id).hidden_by(hidden))


@router.get("/courses/{course_id}/grades/{job_id}", response_model=GradeShape)
def grade(request: Request, here: Reads, context: Context, job_id: RowName) -> Response:
    """One grade, with every criterion and trial, hidden ones among them; 404 until there is one."""
    return grade_answer(request, job_id, _view(context, here, job_id)[1])


@router.get("/courses/{course_id}/grades/{job_id}/report", responses=HTML, response_class=Response)
def report(request: Request, here: Reads, context: Context, job_id: RowName) -> Response:
    """The report of one grade, a page that needs nothing beside it."""
    line, view = _view(context, here, job_id)
    return tagged(request, report_alone(context.store, line, view).encode(), "text/html; charset=utf-8")


@router.get("/courses/{course_id}/grades/{job_id}/replay", responses=REPLAY, response_class=Response)
def replay(request: Request, here: Reads, context: Context, job_id: RowName) -> Response:
    """What a replay of the grade's trials plays."""
    return replay_answer(request, context, job_id, _view(context, here, job_id)[1])


@router.get("/courses/{course_id}/submissions/{submission_id}/files", responses=ZIP, response_class=Response)
def files(here: Reads, context: Context, submission_id: RowNumber) -> Response:
    """What was submitted, as a zip that can be submitted again."""
    with context.store.reading() as session:
        row = submission_in(session, here.course_id, submission_id)
        # Its submission.toml says whose it is.
        if row.assignment in open_assignments.with_names_hidden(session, here.course_id):
            raise nothing_here()
        return packed_answer(session, row)


def graded_view(session: Session, line: JobLine) -> View:
    """All of a grade. Raises HTTPException 404 where there is none."""
    if line.state is not JobState.DONE:
        raise nothing_here()
    return staff_view(results.load(session, line.id))


def grade_answer(request: Request, job_id: str, view: View) -> Response:
    """A view as data."""
    shape = GradeShape.model_validate({"job": job_id, "withheld": view.withheld, **json_document(view)})
    return tagged(request, shape.model_dump_json(by_alias=True).encode(), "application/json")


def replay_answer(request: Request, context: WebContext, job_id: str, view: View) -> Response:
    """What is played of a view."""
    with context.store.reading() as session:
        submission = intake.load_submission(session, job_id)
        floors = own_floors(intake.load_assignment(session, job_id))
    return tagged(
        request, json.dumps(replay_of_grade(view, submission, floors), allow_nan=False).encode(), "application/json"
    )


def packed_answer(session: Session, row: SubmissionRow) -> Response:
    """What was submitted, as it is kept."""
    name = f"submission-{row.id}.zip"
    headers = {"content-disposition": f'attachment; filename="{name}"'}
    return Response(row.packed, media_type="application/zip", headers=headers)


def _view(context: WebContext, here: CallerInCourse, job_id: str) -> tuple[JobLine, View]:
    hidden = hidden_names_of(context.store, here.course_id)
    with context.store.reading() as session:
        job_in(session, here.course_id, job_id)
        line = batches.job_line(session, job_id).hidden_by(hidden)
        view = graded_view(session, line)
    return line, replace(view, grade=replace(view.grade, student=line.student))
