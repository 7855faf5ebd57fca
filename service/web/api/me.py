"""API of the token's owner and the courses in which they have a role."""

from __future__ import annotations

from typing import Annotated

from fastapi import Depends
from pydantic import Field

from service.operations import courses as own_courses
from service.web.api.shapes import CourseShape, Shape, build_example_config
from service.web.api_access import AuthenticatedCaller, Caller, require_scope
from service.web.api_routes import After, Limit, Listed, api_router, build_list_page, decode_cursor
from service.web.context import Context, WebContext

router = api_router("me")


class MeShape(Shape):
    """The owner of the token, with courses and roles."""

    name: str
    operator: bool = Field(description="Whether this person is an operator of the installation.")
    scopes: list[str] = Field(description="Scopes of the token.")
    courses: list[CourseShape]

    model_config = build_example_config(
        name="Grace Hopper",
        operator=False,
        scopes=["mark", "read"],
        courses=[{"id": 1, "name": "TM129", "role": "instructor"}],
    )


@router.get("/me")
def me(caller: AuthenticatedCaller, context: Context) -> MeShape:
    """Return the owner of the token, and its permissions."""
    identity = caller.identity
    return MeShape(
        name=identity.name,
        operator=identity.operator,
        scopes=sorted(identity.scopes or ()),
        courses=_list_courses(context, caller),
    )


@router.get("/courses")
def courses(
    caller: Annotated[Caller, Depends(require_scope("read"))], context: Context, limit: Limit = 50, after: After = ""
) -> Listed[CourseShape]:
    """List the courses in which the token's owner has a role, in the order of creation."""
    sort_key = decode_cursor(after, int)
    last_id = 0 if sort_key is None else sort_key[0]
    lines = [each for each in _list_courses(context, caller) if each.id > last_id]
    return build_list_page(lines[: limit + 1], limit, lambda each: [each.id])


def _list_courses(context: WebContext, caller: Caller) -> list[CourseShape]:
    return [CourseShape.model_validate(each) for each in own_courses.list_own(context.service, caller.actor)]
