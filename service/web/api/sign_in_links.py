"""API of sign-in links for students, for instructors of the course: for one student or for all."""

from __future__ import annotations

from datetime import datetime
from typing import Annotated

from fastapi import Depends
from pydantic import BaseModel, Field

from service.operations import sign_in_links
from service.operations.sign_in_links import StudentLink
from service.operations.types import Role
from service.web.access import RowNumber
from service.web.api.shapes import Shape, build_example_config
from service.web.api_access import CallerInCourse, require_role
from service.web.api_routes import NO_KEY, api_router
from service.web.context import Context, WebContext

router = api_router("people")
ManageAccess = Annotated[CallerInCourse, Depends(require_role(Role.INSTRUCTOR, "manage"))]
_URL_DESCRIPTION = "Null unless ROBOMARK_PUBLIC_URL is set."


class LinkShape(Shape):
    """A single-use sign-in link. It is returned only once."""

    path: str
    url: str | None = Field(description=_URL_DESCRIPTION)

    model_config = build_example_config(path="/sign-in/rml_...", url="https://robomark.example.org/sign-in/rml_...")


class LinksBody(BaseModel):
    """Validity of the links of a course, in days."""

    days: int = Field(sign_in_links.DAYS, ge=1, le=sign_in_links.MAX_DAYS)


class StudentLinkShape(Shape):
    """The sign-in link of one student, or the reason for a missing link."""

    enrolment: int
    id: str
    name: str
    email: str
    path: str | None
    url: str | None = Field(description=_URL_DESCRIPTION)
    expires_at: datetime | None
    reason: str = Field(description="Reason for a missing link; empty if there is a link.")


class StudentLinksShape(Shape):
    """Sign-in links for the students of the course. They are returned only once."""

    links: list[StudentLinkShape]

    model_config = build_example_config(
        links=[
            {
                "enrolment": 7,
                "id": "ada",
                "name": "Ada Lovelace",
                "email": "ada@example.org",
                "path": "/sign-in/rml_...",
                "url": "https://robomark.example.org/sign-in/rml_...",
                "expires_at": "2026-11-09T09:00:00Z",
                "reason": "",
            }
        ]
    )


@router.post("/courses/{course_id}/people/links", status_code=201, openapi_extra=dict(NO_KEY))
def links(access: ManageAccess, context: Context, body: LinksBody | None = None) -> StudentLinksShape:
    """Create sign-in links for the students of the course, by ID. Earlier links become invalid."""
    days = sign_in_links.DAYS if body is None else body.days
    student_links = sign_in_links.make_links(context.service, access.actor, access.course_id, days)
    return StudentLinksShape(links=[_to_student_link_shape(context, each) for each in student_links])


@router.post("/courses/{course_id}/people/{enrolment_id}/link", status_code=201, openapi_extra=dict(NO_KEY))
def link(access: ManageAccess, context: Context, enrolment_id: RowNumber) -> LinkShape:
    """Create a sign-in link for a student of the course. Instructors get theirs from an operator."""
    secret = sign_in_links.make_students_link(context.service, access.actor, access.course_id, enrolment_id)
    return to_link_shape(context, secret)


def to_link_shape(context: WebContext, secret: str) -> LinkShape:
    """Return a sign-in link as the response model."""
    path, public_url = f"/sign-in/{secret}", context.settings.public_url
    return LinkShape(path=path, url=f"{public_url}{path}" if public_url else None)


def _to_student_link_shape(context: WebContext, student_link: StudentLink) -> StudentLinkShape:
    link_shape = None if student_link.secret is None else to_link_shape(context, student_link.secret)
    return StudentLinkShape(
        enrolment=student_link.student.enrolment_id,
        id=student_link.student.id,
        name=student_link.student.name,
        email=student_link.student.email,
        path=None if link_shape is None else link_shape.path,
        url=None if link_shape is None else link_shape.url,
        expires_at=student_link.expires_at,
        reason=student_link.reason,
    )
