"""Similar submissions for a batch's assignments among all students of the course. Only instructors can see this page.

``service.similarity`` compares the submissions. The comparison takes seconds, so it has its own page.
"""

from __future__ import annotations

from fastapi import APIRouter, Request
from fastapi.responses import Response

from service.operations.similarity import show_similar
from service.reports.similarity import render_similarity_body
from service.reports.view import build_similarity_view
from service.web.access import CourseInstructor, RowName
from service.web.context import Context
from service.web.language import detect_language
from service.web.rendering import render_page

router = APIRouter(prefix="/courses/{course_id}/batches/{batch_id}")
_MAX_LISTED_PAIRS = 30


@router.get("/similar")
def show_similar_submissions(
    request: Request, access: CourseInstructor, context: Context, batch_id: RowName
) -> Response:
    """Show pairs of students with similar newest submissions, and the evidence side by side."""
    compared_batch = show_similar(context.service, access.actor, access.course_id, batch_id)
    body = None
    if compared_batch.found is not None:
        links = {
            (each.assignment, each.student): f"/courses/{access.course_id}/grades/{each.id}"
            for each in compared_batch.lines
        }
        view = build_similarity_view(compared_batch.found, detect_language(request))
        body = render_similarity_body(view, compared_batch.source, _MAX_LISTED_PAIRS, links)
    submission_count = len(compared_batch.lines)
    return render_page(
        request,
        access.reader,
        "batch_similar.html",
        access=access,
        batch=compared_batch.batch,
        body=body,
        compared=submission_count,
    )
