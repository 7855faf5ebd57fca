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
    access: CourseInstructor,
    context: Context,
    q: Annotated[str, Query(max_length=100)] = "",
    topic: Annotated[str, Query(max_length=10)] = "",
) -> Response:
    """Show the catalogue's assignments that have the topic and contain all searched words."""
    course_assignments = assignment_views.list_prepared(context.service, access.actor, access.course_id)
    overviews = [read_overview(locate_assignment_folder(each)) for each in list_catalogue_ids()]
    matching_overviews = [each for each in overviews if each.matches_text(q) and topic in ("", each.topic or "none")]
    return render_page(
        request,
        access.reader,
        "catalogue.html",
        access=access,
        overviews=sorted(matching_overviews, key=lambda each: (each.topic == "", each.section, each.title)),
        everything=len(overviews),
        topics={number: TOPICS[number] for number in sorted({each.topic for each in overviews if each.topic})},
        prepared={each.assignment for each in course_assignments},
        text=q,
        topic=topic,
    )


@router.get("/courses/{course_id}/catalogue/{assignment}")
def show_catalogue_entry(
    request: Request, access: CourseInstructor, context: Context, assignment: Annotated[str, InPath(max_length=100)]
) -> Response:
    """Show the task of a catalogue assignment before it is added to the course."""
    catalogue_assignment = find_in_catalogue(assignment)
    course_assignments = assignment_views.list_prepared(context.service, access.actor, access.course_id)
    is_in_course = catalogue_assignment.id in {each.assignment for each in course_assignments}
    return render_page(
        request,
        access.reader,
        "catalogue_entry.html",
        access=access,
        assignment=catalogue_assignment,
        in_course=is_in_course,
    )
