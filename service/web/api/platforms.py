"""API of learning platforms. Operators register them; instructors fetch members and send marks."""

from __future__ import annotations

from typing import Annotated

from fastapi import Depends
from pydantic import BaseModel, Field

from service.operations import platforms
from service.operations.platforms import Registration
from service.operations.types import Role
from service.web.api.shapes import Shape, build_example_config
from service.web.api_access import Caller, CallerInCourse, require_operator, require_role
from service.web.api_routes import Listed, ResponseDescriptions, api_router
from service.web.context import Context

router = api_router("platforms")
OperatorReadAccess = Annotated[Caller, Depends(require_operator("read"))]
OperatorManageAccess = Annotated[Caller, Depends(require_operator("manage"))]
ReadAccess = Annotated[CallerInCourse, Depends(require_role(Role.INSTRUCTOR, "read"))]
ManageAccess = Annotated[CallerInCourse, Depends(require_role(Role.INSTRUCTOR, "manage"))]
Address = Annotated[str, Field(min_length=1, max_length=1000)]
RegisteredText = Annotated[str, Field(min_length=1, max_length=platforms.MAX_REGISTERED_LENGTH)]
_PLATFORM_ERRORS: ResponseDescriptions = {
    502: {
        "content": {"application/problem+json": {"schema": {"$ref": "#/components/schemas/Problem"}}},
        "description": "The platform did not complete the request.",
    }
}
_MOODLE_EXAMPLE = {
    "name": "Moodle",
    "issuer": "https://moodle.example.org",
    "client_id": "a1b2c3",
    "deployments": ["1"],
    "authorization_url": "https://moodle.example.org/mod/lti/auth.php",
    "token_url": "https://moodle.example.org/mod/lti/token.php",
    "keys_url": "https://moodle.example.org/mod/lti/certs.php",
}


class PlatformShape(Shape):
    """A registered learning platform."""

    id: int
    name: str
    issuer: str
    client_id: str
    deployments: list[str]
    authorization_url: str
    token_url: str
    keys_url: str
    service_origins: list[str] = Field(description="Other addresses of its services for members and marks.")

    model_config = build_example_config(id=1, **_MOODLE_EXAMPLE, service_origins=[])


class PlatformBody(BaseModel):
    """A learning platform to register. It replaces a registration with the same issuer and client ID."""

    name: str = Field(min_length=1, max_length=200, examples=[_MOODLE_EXAMPLE["name"]])
    issuer: RegisteredText = Field(examples=[_MOODLE_EXAMPLE["issuer"]])
    client_id: RegisteredText = Field(examples=[_MOODLE_EXAMPLE["client_id"]])
    deployments: list[Address] = Field(min_length=1, max_length=100, examples=[_MOODLE_EXAMPLE["deployments"]])
    authorization_url: Address = Field(examples=[_MOODLE_EXAMPLE["authorization_url"]])
    token_url: Address = Field(examples=[_MOODLE_EXAMPLE["token_url"]])
    keys_url: Address = Field(examples=[_MOODLE_EXAMPLE["keys_url"]])
    service_origins: list[Address] = Field(
        [],
        max_length=20,
        description="Other addresses of its services, in addition to the three addresses.",
        examples=[["https://school.instructure.com"]],
    )


class CoursePlatformShape(Shape):
    """The learning platform from which a course is launched."""

    name: str | None = Field(description="Name of the platform; null if there is none.")
    members: bool = Field(description="Whether the platform provides the list of its members.")
    marks: bool = Field(description="Whether the platform accepts marks.")

    model_config = build_example_config(name="Moodle", members=True, marks=True)


class EnrolledMembersShape(Shape):
    """Number of enrolled members of the platform, and the reasons for rejected members."""

    members: int
    refused: list[str]

    model_config = build_example_config(members=20, refused=[])


class PassBackBody(BaseModel):
    """The assignment whose published marks are sent."""

    assignment: str = Field(min_length=1, max_length=200, examples=["shape-recognition"])


class SentShape(Shape):
    """Number of marks that were sent."""

    sent: int

    model_config = build_example_config(sent=18)


@router.get("/operator/platforms")
def list_platforms(operator: OperatorReadAccess, context: Context) -> Listed[PlatformShape]:
    """List the registered platforms, by name."""
    lines = platforms.list_platforms(context.service, operator.actor)
    return Listed(items=[PlatformShape.model_validate(each) for each in lines])


@router.post("/operator/platforms", status_code=201)
def register(operator: OperatorManageAccess, context: Context, body: PlatformBody) -> Listed[PlatformShape]:
    """Register a platform, or update the one with the same issuer and client ID. Returns all registered platforms."""
    tuples = {"deployments": tuple(body.deployments), "service_origins": tuple(body.service_origins)}
    request = Registration(**(body.model_dump() | tuples))
    lines = platforms.register(context.service, operator.actor, request)
    return Listed(items=[PlatformShape.model_validate(each) for each in lines])


@router.get("/courses/{course_id}/platform")
def course_platform(access: ReadAccess, context: Context) -> CoursePlatformShape:
    """Return the platform from which the course is launched, if there is one."""
    link = platforms.show_course_platform(context.service, access.actor, access.course_id).link
    if link is None:
        return CoursePlatformShape(name=None, members=False, marks=False)
    marks = link.lineitems_url is not None
    return CoursePlatformShape(name=link.platform.name, members=link.members_url is not None, marks=marks)


@router.post("/courses/{course_id}/platform/members", responses=_PLATFORM_ERRORS)
def enrol_members(access: ManageAccess, context: Context) -> EnrolledMembersShape:
    """Enrol all members of the course on the platform."""
    enrolled_members = platforms.enrol_members(context.service, access.actor, access.course_id)
    return EnrolledMembersShape.model_validate(enrolled_members)


@router.post("/courses/{course_id}/platform/marks", responses=_PLATFORM_ERRORS)
def pass_back(access: ManageAccess, context: Context, body: PassBackBody) -> SentShape:
    """Send the published marks of an assignment to the platform's gradebook."""
    return SentShape(sent=platforms.pass_back(context.service, access.actor, access.course_id, body.assignment))
