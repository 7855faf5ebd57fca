"""API of the sessions and tokens of a token's owner: list them and end them one by one."""

from __future__ import annotations

from datetime import datetime
from typing import Annotated

from fastapi import Depends
from fastapi.responses import Response
from pydantic import Field

from service.operations import credentials
from service.operations.types import CredentialKind
from service.web.access import RowName, build_actor
from service.web.api.shapes import Shape, build_example_config
from service.web.api_access import Caller, require_scope
from service.web.api_routes import Listed, api_router
from service.web.context import Context

router = api_router("me")


class CredentialShape(Shape):
    """A session or a token."""

    id: str
    kind: CredentialKind
    name: str
    scopes: list[str] = Field(description="Empty for a session with all rights of its owner.")
    course_id: int | None = Field(description="The only course that it can access; null without this limit.")
    created_at: datetime
    expires_at: datetime
    used_at: datetime | None

    model_config = build_example_config(
        id="7xk2v9q4m0ab",
        kind="token",
        name="marks to the office",
        scopes=["read"],
        course_id=1,
        created_at="2026-11-02T09:00:00Z",
        expires_at="2027-01-31T09:00:00Z",
        used_at="2026-11-03T09:00:00Z",
    )


@router.get("/me/credentials")
def list_credentials(
    caller: Annotated[Caller, Depends(require_scope("read"))], context: Context
) -> Listed[CredentialShape]:
    """List the valid sessions and tokens of the token's owner that the token can access, newest first."""
    lines = credentials.list_credentials(context.service, build_actor(caller.identity))
    return Listed(items=[CredentialShape.model_validate(each) for each in lines])


@router.delete("/me/credentials/{credential_id}", status_code=204, response_class=Response)
def end_credential(
    caller: Annotated[Caller, Depends(require_scope("sign-in"))], context: Context, credential_id: RowName
) -> None:
    """End a session or a token of the token's owner. This can be the token of the request itself."""
    credentials.end_credential(context.service, build_actor(caller.identity), credential_id)
