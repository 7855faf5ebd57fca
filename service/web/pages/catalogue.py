"""The catalogue for instructors, searchable by topic and words. ``assignments.py`` adds assignments to a course."""

from __future__ import annotations

from typing import Annotated

from fastapi import APIRouter, Query, Request
from fastapi import Path as InPath
from fastapi.responses import Response

from service.operations import assignment_views
from service.web.access import CourseInstructor
from service.web.context import Context
from service.web.rendering import render_page
from submissions.assignment.assignment_overview import TOPICS, read_overview
from submissions.assignment.folder import list_catalogue_ids, locate_assignment_folder
from submissions.assignment.reader import find_in_catalogue

router = APIRouter()


@router.get("/courses/{course_id}/catalogue")
def search_catalogue(
    request: Request,
    here: CourseInstructor,
    context: Context,
    q: Annotated[str, Query(max_length=100)] = "",
    topic: Annotated[str, Query(max_length=10)] = "",
) -> Response:
    """Show the catalogue's assignments that have the topic and contain all searched words."""
    taken = assignment_views.list_prepared(context.service, here.actor, here.course_id)
    everything = [read_overview(locate_assignment_folder(each)) for each in list_catalogue_ids()]
    found = [each for each in everything if each.matches_text(q) and topic in ("", each.topic or "none")]
    return render_page(
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
def show_catalogue_entry(
    request: Request, here: CourseInstructor, context: Context, assignment: Annotated[str, InPath(max_length=100)]
) -> Response:
    """Show the task of a catalogue assignment before it is added to the course."""
    found = find_in_catalogue(assignment)
    prepared = assignment_views.list_prepared(context.service, here.actor, here.course_id)
    taken = found.id in {each.assignment for each in prepared}
    return render_page(request, here.reader, "catalogue_entry.html", here=here, found=found, in_course=taken)
