"""The gradebook of a course for its instructors, and its table for download."""

from __future__ import annotations

from typing import Annotated

from fastapi import APIRouter, Query, Request
from fastapi.responses import Response

from service.operations import gradebook
from service.operations.gradebook import GradebookRequest
from service.web.access import CourseInstructor
from service.web.attachments import respond_with_attachment
from service.web.context import EXPORT_IN_PROGRESS, Context, hold_slot
from service.web.pages.batch import STATE_LABELS
from service.web.rendering import render_page

router = APIRouter(prefix="/courses/{course_id}/gradebook")


@router.get("")
def show_gradebook(
    request: Request,
    access: CourseInstructor,
    context: Context,
    q: Annotated[str, Query(max_length=100)] = "",
    sort: Annotated[str, Query(max_length=101)] = "student",
    number: Annotated[int, Query(alias="page", ge=1, le=10_000)] = 1,
) -> Response:
    """Show the students of the course by its assignments."""
    wanted = GradebookRequest(q, sort.removeprefix("-"), sort.startswith("-"), number)
    view = gradebook.show_page(context.service, access.actor, access.course_id, wanted)
    return render_page(
        request, access.reader, "gradebook.html", access=access, view=view, wanted=wanted, states=STATE_LABELS
    )


@router.get("/table")
def download_gradebook(access: CourseInstructor, context: Context) -> Response:
    """Return the whole gradebook as comma-separated values."""
    with hold_slot(context.batch_exports.get_slot(access.actor.person_id), EXPORT_IN_PROGRESS):
        table = gradebook.download_table(context.service, access.actor, access.course_id)
    return respond_with_attachment(table.data, table.name, table.media_type)
