"""The catalogue for instructors, searchable by topic and words. ``assignments.py`` adds assignments to a course."""

from __future__ import annotations

from typing import Annotated

from fastapi import APIRouter, Query, Request
from fastapi import Path as InPath
from fastapi.responses import Response

from service.operations import assignment_views
from service.web.access import Instructing
from service.web.context import Context
from service.web.rendering import page
from submissions.assignment.assignment_overview import TOPICS, overview
from submissions.assignment.folder import assignment_folder, catalogue
from submissions.assignment.reader import find_in_catalogue

router = APIRouter()


@router.get("/courses/{course_id}/catalogue")
def look_through(
    request: Request,
    here: Instructing,
    context: Context,
    q: Annotated[str, Query(max_length=100)] = "",
    topic: Annotated[str, Query(max_length=10)] = "",
) -> Response:
    """Show the catalogue's assignments that have the topic and contain all searched words."""
    taken = assignment_views.list_prepared(context.service, here.acting, here.course_id)
    everything = [overview(assignment_folder(each)) for each in catalogue()]
    found = [each for each in everything if each.says(q) and topic in ("", each.topic or "none")]
    return page(
        request,
        here.reader,
        "catalogue.html",
        here=here,
        found=sorted(found, key=lambda each: (each.topic == "", each.section, each.title)),
        everything=len(everything),
        topics={number: TOPICS[number] for number in sorted({each.topic for each in everything if each.topic})},
        prepared={each.assignment for each in taken},
        text=q,
        topic=topic,
    )


@router.get("/courses/{course_id}/catalogue/{assignment}")
def read(
    request: Request, here: Instructing, context: Context, assignment: Annotated[str, InPath(max_length=100)]
) -> Response:
    """Show the task of a catalogue assignment before it is added to the course."""
    found = find_in_catalogue(assignment)
    prepared = assignment_views.list_prepared(context.service, here.acting, here.course_id)
    taken = found.id in {each.assignment for each in prepared}
    return page(request, here.reader, "catalogue_entry.html", here=here, found=found, in_course=taken)
