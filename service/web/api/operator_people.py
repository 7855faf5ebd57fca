"""API of one person for operators: courses, credentials, signing out, and joining two persons."""

from __future__ import annotations

from typing import Annotated

from fastapi import Depends, Query
from pydantic import BaseModel, Field

from service.operations import people
from service.operations.people import JoinRequest, PersonView
from service.operations.types import Role
from service.web.access import RowNumber
from service.web.api.credentials import CredentialShape
from service.web.api.shapes import Shape, build_example_config, find_example
from service.web.api_access import Caller, require_operator
from service.web.api_routes import api_router
from service.web.context import Context

router = api_router("operator")
ReadAccess = Annotated[Caller, Depends(require_operator("read"))]
ManageAccess = Annotated[Caller, Depends(require_operator("manage"))]


class PersonEnrolmentShape(Shape):
    """The role of a person in one course."""

    enrolment: int
    course: str
    id: str
    name: str
    role: Role

    model_config = build_example_config(enrolment=9, course="TM129", id="grace", name="Grace Hopper", role="instructor")


class PersonShape(Shape):
    """A person, with all enrolments, sessions and tokens."""

    enrolments: list[PersonEnrolmentShape]
    credentials: list[CredentialShape]
    from_platform: bool = Field(description="Whether this person signs in through a learning platform.")

    model_config = build_example_config(
        enrolments=[find_example(PersonEnrolmentShape)],
        credentials=[find_example(CredentialShape)],
        from_platform=False,
    )


class SignOutBody(BaseModel):
    """Options for signing a person out."""

    release: bool = Field(
        False, description="Allow the next launch by a student with this ID to take over this account."
    )


class SignedOutShape(Shape):
    """Number of links, sessions and tokens that were ended."""

    ended: int

    model_config = build_example_config(ended=3)


class JoinBody(BaseModel):
    """The other person to merge."""

    other: int = Field(ge=1, le=2**31 - 1, description="ID of one of their enrolments.", examples=[4])
    from_platform: bool = Field(False, description="Merge even if one of them signs in through a learning platform.")


@router.get("/operator/people")
def find(
    operator: ReadAccess,
    context: Context,
    course: Annotated[str, Query(min_length=1, max_length=100)],
    id: Annotated[str, Query(min_length=1, max_length=200)],
) -> PersonShape:
    """Return the person with an ID in a course."""
    actor = operator.actor
    member = people.find(context.service, actor, course, id)
    return _to_person_shape(people.show(context.service, actor, member.enrolment_id))


@router.post("/operator/people/{member_id}/sign-out")
def sign_out(
    operator: ManageAccess, context: Context, member_id: RowNumber, body: SignOutBody | None = None
) -> SignedOutShape:
    """End all links, sessions and tokens of a person."""
    release = body is not None and body.release
    return SignedOutShape(ended=people.sign_out(context.service, operator.actor, member_id, release=release))


@router.post("/operator/people/{member_id}/join")
def join(operator: ManageAccess, context: Context, member_id: RowNumber, body: JoinBody) -> PersonShape:
    """Merge two persons in different courses into one, and sign both out."""
    actor = operator.actor
    people.join(context.service, actor, JoinRequest(member_id, body.other, body.from_platform))
    return _to_person_shape(people.show(context.service, actor, member_id))


def _to_person_shape(view: PersonView) -> PersonShape:
    return PersonShape(
        enrolments=[
            PersonEnrolmentShape(enrolment=each.enrolment_id, course=name, id=each.id, name=each.name, role=each.role)
            for name, each in view.enrolments
        ],
        credentials=[CredentialShape.model_validate(each) for each in view.credentials],
        from_platform=view.from_platform,
    )
