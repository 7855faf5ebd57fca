"""Learning platforms. Operators register them; instructors fetch members and send marks."""

from __future__ import annotations

from typing import Annotated

from fastapi import APIRouter, Form, Request
from fastapi.responses import RedirectResponse, Response

from service.operations import platforms as operations
from service.operations.platforms import EnrolledMembers, Registration
from service.web.access import CourseInstructor, OperatorReader, ReaderInCourse
from service.web.context import Context, WebContext
from service.web.rendering import render_page

router = APIRouter()
Address = Annotated[str, Form(min_length=1, max_length=1000)]
RegisteredText = Annotated[str, Form(min_length=1, max_length=operations.MAX_REGISTERED_LENGTH)]


@router.get("/operator/platforms")
def list_platforms(request: Request, reader: OperatorReader, context: Context) -> Response:
    """Show the registered platforms, the values for a platform's administrator, and a form to register one."""
    lines = operations.list_platforms(context.service, reader.actor)
    start = context.settings.public_url or str(request.base_url).rstrip("/")
    return render_page(request, reader, "platforms.html", platforms=lines, start=start)


@router.post("/operator/platforms")
def register(
    reader: OperatorReader,
    context: Context,
    name: Annotated[str, Form(min_length=1, max_length=200)],
    issuer: RegisteredText,
    client_id: RegisteredText,
    deployments: Address,
    authorization_url: Address,
    token_url: Address,
    keys_url: Address,
    service_origins: Annotated[str, Form(max_length=1000)] = "",
) -> Response:
    """Register a platform, or change the one with the same issuer and client id."""
    deployment_ids, origins = (each.replace(",", " ").split() for each in (deployments, service_origins))
    addresses = (authorization_url, token_url, keys_url)
    registration = Registration(name, issuer, client_id, tuple(deployment_ids), *addresses, tuple(origins))
    operations.register(context.service, reader.actor, registration)
    return RedirectResponse("/operator/platforms", 303)


@router.get("/courses/{course_id}/platform")
def show_course_platform(request: Request, access: CourseInstructor, context: Context) -> Response:
    """Show the course's platform, with buttons to fetch members and send marks."""
    return _render_course_platform(request, access, context)


@router.post("/courses/{course_id}/platform/members")
def fetch_members(request: Request, access: CourseInstructor, context: Context) -> Response:
    """Enrol all members of the course on the platform."""
    enrolled_members = operations.enrol_members(context.service, access.actor, access.course_id)
    return _render_course_platform(request, access, context, enrolled_members=enrolled_members)


@router.post("/courses/{course_id}/platform/marks")
def pass_back(
    request: Request, access: CourseInstructor, context: Context, assignment: Annotated[str, Form(max_length=200)]
) -> Response:
    """Send the published marks of an assignment to the platform's gradebook."""
    sent_count = operations.pass_back(context.service, access.actor, access.course_id, assignment)
    return _render_course_platform(request, access, context, sent_count=sent_count)


def _render_course_platform(
    request: Request,
    access: ReaderInCourse,
    context: WebContext,
    *,
    enrolled_members: EnrolledMembers | None = None,
    sent_count: int | None = None,
) -> Response:
    view = operations.show_course_platform(context.service, access.actor, access.course_id)
    return render_page(
        request,
        access.reader,
        "course_platform.html",
        access=access,
        link=view.link,
        assignments=view.assignments,
        enrolled=enrolled_members,
        sent=sent_count,
    )
