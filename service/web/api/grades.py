"""API of one grade for staff: data, report, replay and submission."""

from __future__ import annotations

import json
from collections.abc import Mapping
from typing import Annotated, Any

from fastapi import Depends, Request
from fastapi.responses import Response

from service.operations import grade_views
from service.operations.types import Role
from service.reports.formats.json_output import build_json_document
from service.reports.view import View
from service.web.access import RowName, RowNumber
from service.web.api.shapes import GradeShape, JobShape
from service.web.api_access import CallerInCourse, require_role
from service.web.api_routes import ResponseDescriptions, api_router, respond_with_etag
from service.web.attachments import respond_with_attachment
from service.web.context import Context
from service.web.language import detect_language

router = api_router("grades")
ReadAccess = Annotated[CallerInCourse, Depends(require_role(Role.INSTRUCTOR, "read"))]
HTML_RESPONSES: ResponseDescriptions = {
    200: {"content": {"text/html": {"schema": {"type": "string"}}}, "description": "A self-contained page."}
}
ZIP_RESPONSES: ResponseDescriptions = {
    200: {"content": {"application/zip": {"schema": {"type": "string", "format": "binary"}}}, "description": "A zip."}
}
REPLAY_RESPONSES: ResponseDescriptions = {
    200: {
        "content": {"application/json": {"schema": {"type": "object"}}},
        "description": "Replay data, as written by `robomark show --replay`: floors, sources, trials.",
    }
}


@router.get("/courses/{course_id}/grades/{job_id}/state")
def state(access: ReadAccess, context: Context, job_id: RowName) -> JobShape:
    """Return the state of one grading job."""
    return JobShape.model_validate(grade_views.show_state(context.service, access.actor, access.course_id, job_id))


@router.get("/courses/{course_id}/grades/{job_id}", response_model=GradeShape)
def grade(request: Request, access: ReadAccess, context: Context, job_id: RowName) -> Response:
    """Return a grade with all criteria and trials, including hidden ones; 404 if there is no grade yet."""
    return respond_with_grade(
        request, job_id, grade_views.show_result(context.service, access.actor, access.course_id, job_id)
    )


@router.get("/courses/{course_id}/grades/{job_id}/report", responses=HTML_RESPONSES, response_class=Response)
def report(request: Request, access: ReadAccess, context: Context, job_id: RowName) -> Response:
    """Return the report of a grade as a self-contained page, in the language of `Accept-Language`."""
    language = detect_language(request)
    return respond_with_report(
        request, grade_views.show_report(context.service, access.actor, access.course_id, job_id, language)
    )


@router.get("/courses/{course_id}/grades/{job_id}/replay", responses=REPLAY_RESPONSES, response_class=Response)
def replay(request: Request, access: ReadAccess, context: Context, job_id: RowName) -> Response:
    """Return the replay data of the grade's trials."""
    return respond_with_replay(
        request, grade_views.show_replay(context.service, access.actor, access.course_id, job_id)
    )


@router.get("/courses/{course_id}/submissions/{submission_id}/files", responses=ZIP_RESPONSES, response_class=Response)
def files(access: ReadAccess, context: Context, submission_id: RowNumber) -> Response:
    """Return the submitted files, as a zip that can be submitted again."""
    archive = grade_views.show_files(context.service, access.actor, access.course_id, submission_id)
    return respond_with_attachment(archive.data, archive.name, "application/zip")


def respond_with_grade(request: Request, job_id: str, view: View) -> Response:
    """Return a grade as JSON."""
    shape = GradeShape.model_validate({"job": job_id, "withheld": view.withheld, **build_json_document(view)})
    return respond_with_etag(request, shape.model_dump_json(by_alias=True).encode(), "application/json")


def respond_with_report(request: Request, report: str) -> Response:
    """Return a report as a page. It varies by language, so caches store one for each."""
    return respond_with_etag(request, report.encode(), "text/html; charset=utf-8", vary="accept-language")


def respond_with_replay(request: Request, document: Mapping[str, Any]) -> Response:
    """Return the data of a replay as JSON."""
    return respond_with_etag(request, json.dumps(document, allow_nan=False).encode(), "application/json")
