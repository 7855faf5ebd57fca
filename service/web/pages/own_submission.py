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
def show_own_submission(
    request: Request, access: CourseStudent, context: Context, submission_id: RowNumber
) -> Response:
    """Show the progress or the report of a submission.

    Requests from htmx get only the progress, or an instruction to reload the page when grading has ended.
    """
    submission_key = (context.service, access.actor, access.course_id, submission_id)
    if is_htmx_request(request):
        progress_view = own_views.show_submission(*submission_key)
        if progress_view.place is None:
            return Response(headers={"hx-refresh": "true"})
        return render_page(
            request,
            access.reader,
            "own_progress.html",
            access=access,
            submission=progress_view.submission,
            place=progress_view.place,
        )
    view = own_views.show_submission_report(*submission_key, detect_language(request))
    return render_page(
        request,
        access.reader,
        "own_submission.html",
        access=access,
        submission=view.submission,
        place=view.place,
        attempts=view.attempts,
        counting=view.counting,
        is_open=view.is_open,
        curve=compute_marks_curve(view.attempts),
        allowance=view.allowance,
        appeals=view.appeals,
        report=view.report,
    )


@router.get("/courses/{course_id}/mine/submissions/{submission_id}/files")
def download_own_files(access: CourseStudent, context: Context, submission_id: RowNumber) -> Response:
    """Return the submitted files as a zip that can be submitted again."""
    context.limits.files.spend(str(access.actor.person_id))
    archive = own_views.show_files(context.service, access.actor, access.course_id, submission_id)
    return respond_with_attachment(archive.data, archive.name, "application/zip")
