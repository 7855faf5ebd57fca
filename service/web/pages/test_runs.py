"""Test runs: the editors, the progress, the output and the replay. A test run has no marks."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Annotated

from fastapi import APIRouter, Query, Request
from fastapi.responses import Response

from service.operations import own_views, test_runs
from service.operations.test_runs import TextOrigin
from service.operations.types import Role
from service.reports.display_text import join_wrapped_lines
from service.web.access import CourseStudent, ReaderInCourse
from service.web.api_uploads import MAX_SUBMISSION_BYTES
from service.web.context import Context, WebContext
from service.web.pages.own_assignments import Files, Texts, collect_sent_files
from service.web.rendering import is_htmx_request, render_page
from service.web.request_bodies import takes_upload
from service.web.run_responses import (
    Rejection,
    describe_run,
    find_rejection,
    render_progress,
    respond_to_start,
)
from service.web.student_submissions import start_test_run

router = APIRouter()


@router.get("/courses/{course_id}/mine/{assignment}/try")
def show_newest_test_run(
    request: Request,
    access: CourseStudent,
    context: Context,
    assignment: str,
    origin: Annotated[TextOrigin | None, Query(alias="from")] = None,
) -> Response:
    """Show the newest test run, and the editors with the chosen program, by default the latest.

    Requests from htmx get only the progress or the result.
    """
    if is_htmx_request(request):
        line = test_runs.find_newest(context.service, access.actor, access.course_id, assignment)
        if line is None or line.waits:
            return render_progress(request, access, line)
        result = test_runs.show_newest_result(context.service, access.actor, access.course_id, assignment)
        run = describe_run(request, result.line, result.replay, result.files, has_program=True)
        return render_page(request, access.reader, "run_result.html", status_code=200, **run)
    return _render_test_run(request, access, context, assignment, origin=origin)


@router.post("/courses/{course_id}/mine/{assignment}/try")
@takes_upload(MAX_SUBMISSION_BYTES, Role.STUDENT)
def submit_test_run(
    request: Request, access: CourseStudent, context: Context, assignment: str, files: Files = (), texts: Texts = ()
) -> Response:
    """Start a test run of the chosen files and typed texts."""
    sheet = own_views.show_sheet(context.service, access.actor, access.course_id, assignment)
    rejection = find_rejection(
        request,
        lambda: start_test_run(
            context, access.actor, access.course_id, assignment, collect_sent_files(sheet.asked, files, texts)
        ),
    )
    if rejection is not None and not is_htmx_request(request):
        return _render_test_run(request, access, context, assignment, rejection=rejection, typed_texts=texts)
    line = test_runs.find_newest(context.service, access.actor, access.course_id, assignment)
    return respond_to_start(request, access, rejection, line)


def _render_test_run(
    request: Request,
    access: ReaderInCourse,
    context: WebContext,
    assignment: str,
    *,
    origin: TextOrigin | None = None,
    rejection: Rejection | None = None,
    typed_texts: Sequence[str] = (),
) -> Response:
    view = test_runs.show_newest(context.service, access.actor, access.course_id, assignment, origin)
    has_program = view.origin is TextOrigin.TEST_RUN and not typed_texts
    page = render_page(
        request,
        access.reader,
        "test_run.html",
        status_code=rejection.status if rejection else 200,
        access=access,
        sheet=view.sheet,
        description=join_wrapped_lines(view.sheet.description),
        seconds=view.seconds,
        picture=view.picture,
        allowance=view.allowance,
        counting=view.counting,
        is_open=view.is_open,
        closed_at=view.closed_at,
        origins=view.origins,
        origin=view.origin,
        rejection=rejection,
        texts=list(typed_texts) or view.texts,
        **describe_run(request, view.line, view.replay, view.sheet.asked, has_program=has_program),
    )
    page.headers.update(rejection.headers if rejection else {})
    return page
