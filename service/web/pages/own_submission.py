"""One of a student's own submissions: place in the queue, report, and other attempts.

``appeals.py`` contains the page for appeals. ``reports/view.py`` decides which parts of a grade are shown.
"""

from __future__ import annotations

from fastapi import APIRouter, Request
from fastapi.responses import Response

from service.operations import own_views
from service.web.access import CourseStudent, RowNumber
from service.web.attachments import respond_with_attachment
from service.web.context import Context
from service.web.language import detect_language
from service.web.pages.own_assignments import compute_marks_curve
from service.web.rendering import is_htmx_request, render_page

router = APIRouter()


@router.get("/courses/{course_id}/mine/submissions/{submission_id}")
def show_own_submission(request: Request, here: CourseStudent, context: Context, submission_id: RowNumber) -> Response:
    """Show the progress or the report of a submission.

    Requests from htmx get only the progress, or an instruction to reload the page when grading has ended.
    """
    asked = (context.service, here.actor, here.course_id, submission_id)
    if is_htmx_request(request):
        part = own_views.show_submission(*asked)
        if part.place is None:
            return Response(headers={"hx-refresh": "true"})
        return render_page(
            request, here.reader, "own_progress.html", here=here, found=part.submission, place=part.place
        )
    found = own_views.show_submission_report(*asked, detect_language(request))
    return render_page(
        request,
        here.reader,
        "own_submission.html",
        here=here,
        found=found.submission,
        place=found.place,
        attempts=found.attempts,
        counting=found.counting,
        is_open=found.is_open,
        curve=compute_marks_curve(found.attempts),
        allowance=found.allowance,
        appeals=found.appeals,
        report=found.report,
    )


@router.get("/courses/{course_id}/mine/submissions/{submission_id}/files")
def download_own_files(here: CourseStudent, context: Context, submission_id: RowNumber) -> Response:
    """Return the submitted files as a zip that can be submitted again."""
    found = own_views.show_files(context.service, here.actor, here.course_id, submission_id)
    return respond_with_attachment(found.data, found.name, "application/zip")
