"""API of one grade for staff: data, report, replay and submission."""

from __future__ import annotations

import json
from collections.abc import Mapping
from typing import Annotated, Any

from fastapi import Depends, Request
from fastapi.responses import Response

from service.operations import grade_views
from service.operations.types import Role
from service.reports.formats.json_output import json_document
from service.reports.view import View
from service.web.access import RowName, RowNumber
from service.web.api.shapes import GradeShape, JobShape
from service.web.api_access import CallerInCourse, in_course
from service.web.api_routes import Described, api_router, tagged
from service.web.attachments import attachment
from service.web.context import Context
from service.web.language import language_of

router = api_router("grades")
Reads = Annotated[CallerInCourse, Depends(in_course(Role.INSTRUCTOR, "read"))]
HTML: Described = {
    200: {"content": {"text/html": {"schema": {"type": "string"}}}, "description": "A self-contained page."}
}
ZIP: Described = {
    200: {"content": {"application/zip": {"schema": {"type": "string", "format": "binary"}}}, "description": "A zip."}
}
REPLAY: Described = {
    200: {
        "content": {"application/json": {"schema": {"type": "object"}}},
        "description": "Replay data, as written by `robomark show --replay`: floors, sources, trials.",
    }
}


@router.get("/courses/{course_id}/grades/{job_id}/state")
def state(here: Reads, context: Context, job_id: RowName) -> JobShape:
    """Return the state of one grading job."""
    return JobShape.model_validate(grade_views.show_state(context.service, here.acting, here.course_id, job_id))


@router.get("/courses/{course_id}/grades/{job_id}", response_model=GradeShape)
def grade(request: Request, here: Reads, context: Context, job_id: RowName) -> Response:
    """Return a grade with all criteria and trials, including hidden ones; 404 if there is no grade yet."""
    return grade_answer(request, job_id, grade_views.show_result(context.service, here.acting, here.course_id, job_id))


@router.get("/courses/{course_id}/grades/{job_id}/report", responses=HTML, response_class=Response)
def report(request: Request, here: Reads, context: Context, job_id: RowName) -> Response:
    """Return the report of a grade as a self-contained page, in the language of `Accept-Language`."""
    language = language_of(request)
    return report_answer(
        request, grade_views.show_report(context.service, here.acting, here.course_id, job_id, language)
    )


@router.get("/courses/{course_id}/grades/{job_id}/replay", responses=REPLAY, response_class=Response)
def replay(request: Request, here: Reads, context: Context, job_id: RowName) -> Response:
    """Return the replay data of the grade's trials."""
    return replay_answer(request, grade_views.show_replay(context.service, here.acting, here.course_id, job_id))


@router.get("/courses/{course_id}/submissions/{submission_id}/files", responses=ZIP, response_class=Response)
def files(here: Reads, context: Context, submission_id: RowNumber) -> Response:
    """Return the submitted files, as a zip that can be submitted again."""
    found = grade_views.show_files(context.service, here.acting, here.course_id, submission_id)
    return attachment(found.data, found.name, "application/zip")


def grade_answer(request: Request, job_id: str, view: View) -> Response:
    """Return a grade as JSON."""
    shape = GradeShape.model_validate({"job": job_id, "withheld": view.withheld, **json_document(view)})
    return tagged(request, shape.model_dump_json(by_alias=True).encode(), "application/json")


def report_answer(request: Request, report: str) -> Response:
    """Return a report as a page. It varies by language, so caches store one for each."""
    return tagged(request, report.encode(), "text/html; charset=utf-8", vary="accept-language")


def replay_answer(request: Request, document: Mapping[str, Any]) -> Response:
    """Return the data of a replay as JSON."""
    return tagged(request, json.dumps(document, allow_nan=False).encode(), "application/json")
