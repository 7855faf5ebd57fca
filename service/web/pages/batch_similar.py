"""Similar submissions for a batch's assignments among all students of the course. Only instructors can see this page.

``service.similarity`` compares the submissions. The comparison takes seconds, so it has its own page.
"""

from __future__ import annotations

from fastapi import APIRouter, Request
from fastapi.responses import Response

from service.operations.similarity import show_similar
from service.reports.similarity import similarity_body
from service.reports.view import staff_similarity
from service.web.access import Instructing, RowName
from service.web.context import Context
from service.web.language import language_of
from service.web.rendering import page

router = APIRouter(prefix="/courses/{course_id}/batches/{batch_id}")
_MOST_SHOWN = 30


@router.get("/similar")
def similar(request: Request, here: Instructing, context: Context, batch_id: RowName) -> Response:
    """Show pairs of students with similar newest submissions, and the evidence side by side."""
    found = show_similar(context.service, here.acting, here.course_id, batch_id)
    body = None
    if found.found is not None:
        links = {(each.assignment, each.student): f"/courses/{here.course_id}/grades/{each.id}" for each in found.lines}
        view = staff_similarity(found.found, language_of(request))
        body = similarity_body(view, found.source, _MOST_SHOWN, links)
    compared = len(found.lines)
    return page(request, here.reader, "batch_similar.html", here=here, batch=found.batch, body=body, compared=compared)
