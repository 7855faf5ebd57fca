"""Whose work for the assignments of a batch is alike, among all students of the course: for who instructs it alone.

What is alike is ``service.similarity``'s to say. It takes seconds, so it is a page of its own, and of few enough.
"""

from __future__ import annotations

from fastapi import APIRouter, Request
from fastapi.responses import Response

from service.reports.similarity import similarity_body
from service.reports.view import staff_similarity
from service.store.batches import batches
from service.store.batches.similarities import MOST_AT_ONCE, SourceTexts, newest_of_course, similarities
from service.store.installation import secret_of
from service.web.access import Instructing, RowName, batch_in
from service.web.context import Context
from service.web.language import language_of
from service.web.rendering import page

router = APIRouter(prefix="/courses/{course_id}/batches/{batch_id}")
_MOST_SHOWN = 30


@router.get("/similar")
def similar(request: Request, here: Instructing, context: Context, batch_id: RowName) -> Response:
    """Pairs of students whose newest submissions are alike, with the evidence side by side."""
    secret = secret_of(context.store)
    with context.store.reading() as session:
        batch_in(session, here.course_id, batch_id)
        line = batches.batch(session, batch_id)
        lines = newest_of_course(session, here.course_id, batch_id, secret)
    body = None
    if len(lines) <= MOST_AT_ONCE:
        links = {(each.assignment, each.student): f"/courses/{here.course_id}/grades/{each.id}" for each in lines}
        view = staff_similarity(similarities(context.store, lines), language_of(request))
        body = similarity_body(view, SourceTexts(context.store, lines).of, _MOST_SHOWN, links)
    return page(request, here.reader, "batch_similar.html", here=here, batch=line, body=body, compared=len(lines))
