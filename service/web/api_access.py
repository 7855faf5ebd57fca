"""Access control for the API: a request needs a token with the scope, whose owner has the role. Cookies are ignored."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Annotated

from fastapi import Depends, Request
from fastapi.security import HTTPBearer
from fastapi.security.utils import get_authorization_scheme_param
from starlette.exceptions import HTTPException

from service.operations import courses, sign_in
from service.operations.context import Actor
from service.operations.scopes import SCOPES
from service.operations.sign_in import Identity
from service.operations.types import CredentialKind, Role
from service.web.access import RowNumber, SignInNeeded, actor_from, nothing_here
from service.web.context import Context

#: Describes the authentication in the OpenAPI document. ``caller_of`` checks the token.
bearer = HTTPBearer(auto_error=False, description="A token from `/account` or `robomark user token`.")


@dataclass(frozen=True, slots=True)
class Caller:
    """The owner of a token."""

    identity: Identity

    @property
    def acting(self) -> Actor:
        """Return the caller as an actor for operations."""
        return actor_from(self.identity)


@dataclass(frozen=True, slots=True)
class CallerInCourse:
    """The owner of a token in a course in which they have a role."""

    caller: Caller
    course_id: int

    @property
    def acting(self) -> Actor:
        """Return the caller as an actor for operations."""
        return self.caller.acting


def caller_of(request: Request, context: Context) -> Caller:
    """Return the owner of the request's token.

    Raises:
        SignInNeeded: The token is missing or invalid.
        HTTPException: 429 if the token's rate limit is exceeded.
    """
    scheme, secret = get_authorization_scheme_param(request.headers.get("authorization"))
    if scheme.lower() != "bearer" or not secret:
        raise SignInNeeded("a token is required")
    identity = sign_in.identify(context.service, secret, CredentialKind.TOKEN)
    if identity is None:
        raise SignInNeeded("the token is invalid or has expired")
    context.limits.api_calls.spend(identity.credential_id)
    if not identity.use_is_noted:
        sign_in.note_use(context.service, identity)
    return Caller(identity)


def _called(request: Request, context: Context, _told: Annotated[object, Depends(bearer)]) -> Caller:
    return caller_of(request, context)


Called = Annotated[Caller, Depends(_called)]


def with_scope(scope: str) -> Callable[[Caller], Caller]:
    """Return a dependency that requires a token scope. Use as ``Depends(with_scope("read"))``."""
    assert scope in SCOPES

    def caller(caller: Called) -> Caller:
        if caller.identity.scopes is None or scope not in caller.identity.scopes:
            raise HTTPException(403, f"This token does not have the scope {scope}.")
        return caller

    return caller


def in_course(role: Role, scope: str) -> Callable[[int, Caller, Context], CallerInCourse]:
    """Return a dependency that requires a role in the path's course and a token scope."""
    scoped = with_scope(scope)

    def caller_in_course(course_id: RowNumber, caller: Called, context: Context) -> CallerInCourse:
        course = courses.show_own(context.service, caller.acting, course_id, role)
        return CallerInCourse(scoped(caller), course.id)

    return caller_in_course


def operating(scope: str) -> Callable[[Caller], Caller]:
    """Return a dependency that requires an operator and a token scope."""
    scoped = with_scope(scope)

    def operator(caller: Called) -> Caller:
        if not caller.identity.operator:
            raise nothing_here()
        return scoped(caller)

    return operator
