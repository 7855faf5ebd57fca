"""Test runs: the form, the progress, the output and the replay. A test run has no marks."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from fastapi import APIRouter, Request
from fastapi.responses import RedirectResponse, Response
from starlette.exceptions import HTTPException

from service.operations import own_views, test_runs
from service.operations.errors import NotFound
from service.operations.types import Role
from service.reports.html import render_replay_section
from service.web.access import CourseStudent, ReaderInCourse
from service.web.api_uploads import MAX_SUBMISSION_BYTES
from service.web.context import Context, WebContext
from service.web.errors import describe_error
from service.web.http_errors import extract_message
from service.web.language import detect_language
from service.web.pages.own_assignments import Files, Texts, collect_sent_files
from service.web.rendering import is_htmx_request, render_page
from service.web.request_bodies import takes_upload
from service.web.student_submissions import start_test_run
from sim.errors import UsageError
from submissions.assignment.task_sheet import TaskSheet
from submissions.submission import PART_FILES, Submission

router = APIRouter()


@router.get("/courses/{course_id}/mine/{assignment}/try")
def show_newest_test_run(request: Request, access: CourseStudent, context: Context, assignment: str) -> Response:
    """Show the newest test run, with its program in the form for the next one.

    Requests from htmx get only the progress, or an instruction to reload the page when the run has ended.
    """
    if not is_htmx_request(request):
        return _render_test_run(request, access, context, assignment)
    line = test_runs.find_newest(context.service, access.actor, access.course_id, assignment)
    if line is None or not line.waits:
        return Response(headers={"hx-refresh": "true"})
    return render_page(request, access.reader, "test_run_progress.html", access=access, line=line)


@router.post("/courses/{course_id}/mine/{assignment}/try")
@takes_upload(MAX_SUBMISSION_BYTES, Role.STUDENT)
def submit_test_run(
    request: Request, access: CourseStudent, context: Context, assignment: str, files: Files = (), texts: Texts = ()
) -> Response:
    """Start a test run of the chosen files and typed texts."""
    sheet = own_views.show_sheet(context.service, access.actor, access.course_id, assignment)
    try:
        start_test_run(context, access.actor, access.course_id, assignment, collect_sent_files(sheet, files, texts))
    except NotFound:
        raise
    except UsageError as error:
        return _render_test_run(
            request, access, context, assignment, 422, describe_error(error, detect_language(request)), texts
        )
    except HTTPException as error:
        if error.status_code != 429:
            raise
        sentence = detect_language(request).translate_sentence(extract_message(error))
        return _render_test_run(request, access, context, assignment, 429, sentence, texts, error.headers)
    return RedirectResponse(str(request.url.path), 303)


def _render_test_run(
    request: Request,
    access: ReaderInCourse,
    context: WebContext,
    assignment: str,
    status: int = 200,
    message: str = "",
    typed_texts: Sequence[str] = (),
    headers: Mapping[str, str] | None = None,
) -> Response:
    view = test_runs.show_newest(context.service, access.actor, access.course_id, assignment)
    page = render_page(
        request,
        access.reader,
        "test_run.html",
        status_code=status,
        access=access,
        sheet=view.sheet,
        seconds=view.seconds,
        line=view.line,
        replay=render_replay_section(view.replay, detect_language(request)) if view.replay else None,
        rejection=message,
        texts=list(typed_texts) or (_read_texts(view.sheet, view.submission) if view.submission else []),
    )
    page.headers.update(headers or {})
    return page


def _read_texts(sheet: TaskSheet, submission: Submission) -> list[str]:
    """Return the texts of the test run's files, in the order of the requested files.

    A missing file gives an empty text.
    """
    parts = {PART_FILES["program"]: submission.program, PART_FILES["responder"]: submission.responder}
    texts = []
    for name in sheet.asked:
        code = parts.get(name)
        texts.append(code.text if code is not None else submission.files.get(name, b"").decode("utf-8", "replace"))
    return texts
