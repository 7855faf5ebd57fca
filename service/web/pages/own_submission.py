"""One of a student's own submissions: place in the queue, report, and other attempts.

``appeals.py`` contains the page for appeals. ``reports/view.py`` decides which parts of a grade are shown.
"""

from __future__ import annotations

from fastapi import APIRouter, Request
from fastapi.responses import Response

from service.operations import own_views
from service.web.access import RowNumber, Studying
from service.web.attachments import attachment
from service.web.context import Context
from service.web.language import language_of
from service.web.pages.mine import curve
from service.web.rendering import page, wants_part

router = APIRouter()


@router.get("/courses/{course_id}/mine/submissions/{submission_id}")
def own_submission(request: Request, here: Studying, context: Context, submission_id: RowNumber) -> Response:
    """Show the progress or the report of a submission.

    Requests from htmx get only the progress, or an instruction to reload the page when grading has ended.
    """
    asked = (context.service, here.acting, here.course_id, submission_id)
    if wants_part(request):
        part = own_views.show_submission(*asked)
        if part.place is None:
            return Response(headers={"hx-refresh": "true"})
        return page(request, here.reader, "own_progress.html", here=here, found=part.submission, place=part.place)
    found = own_views.show_submission_report(*asked, language_of(request))
    return page(
        request,
        here.reader,
        "own_submission.html",
        here=here,
        found=found.submission,
        place=found.place,
        attempts=found.attempts,
        counting=found.counting,
        is_open=found.is_open,
        curve=curve(found.attempts),
        allowance=found.allowance,
        appeals=found.appeals,
        report=found.report,
    )


@router.get("/courses/{course_id}/mine/submissions/{submission_id}/files")
def own_files(here: Studying, context: Context, submission_id: RowNumber) -> Response:
    """Return the submitted files as a zip that can be submitted again."""
    found = own_views.show_files(context.service, here.acting, here.course_id, submission_id)
    return attachment(found.data, found.name, "application/zip")
