"""One person for operators: courses, credentials, and joining with another person."""

from __future__ import annotations

from typing import Annotated
from urllib.parse import urlencode

from fastapi import APIRouter, Form, Query, Request
from fastapi.responses import RedirectResponse, Response

from service.operations import people
from service.operations.people import JoinRequest
from service.web.access import OperatorReader, RowNumber, SentRowNumber
from service.web.context import Context
from service.web.rendering import render_page

router = APIRouter(prefix="/operator/people")
CourseName = Annotated[str, Query(max_length=100)]
Id = Annotated[str, Query(max_length=200)]


@router.get("")
def find_person(
    request: Request, reader: OperatorReader, context: Context, course: CourseName = "", who: Id = ""
) -> Response:
    """Show a form that finds a person by course and id."""
    if not course or not who:
        return render_page(request, reader, "operator_people.html")
    person = people.find(context.service, reader.actor, course.strip(), who.strip())
    return RedirectResponse(f"/operator/people/{person.enrolment_id}", 303)


@router.get("/{member_id}")
def show_person(
    request: Request,
    reader: OperatorReader,
    context: Context,
    member_id: RowNumber,
    course: CourseName = "",
    who: Id = "",
    ended: Annotated[int | None, Query(ge=0, le=1_000_000)] = None,
) -> Response:
    """Show a person. With a course and an id, also show the person to join them with."""
    actor = reader.actor
    view = people.show(context.service, actor, member_id)
    other_view = None
    if course and who:
        other_person = people.find(context.service, actor, course.strip(), who.strip())
        other_view = people.show(context.service, actor, other_person.enrolment_id)
    return render_page(request, reader, "operator_person.html", view=view, other=other_view, ended=ended)


@router.post("/{member_id}/sign-out")
def sign_out(
    reader: OperatorReader, context: Context, member_id: RowNumber, release: Annotated[bool, Form()] = False
) -> Response:
    """End all links, sessions and tokens of a person."""
    ended_count = people.sign_out(context.service, reader.actor, member_id, release=release)
    return RedirectResponse(f"/operator/people/{member_id}?{urlencode({'ended': ended_count})}", 303)


@router.post("/{member_id}/join")
def join(
    reader: OperatorReader,
    context: Context,
    member_id: RowNumber,
    other_id: SentRowNumber,
    from_platform: Annotated[bool, Form()] = False,
) -> Response:
    """Join the two persons that the page shows."""
    people.join(context.service, reader.actor, JoinRequest(member_id, other_id, from_platform))
    return RedirectResponse(f"/operator/people/{member_id}", 303)
