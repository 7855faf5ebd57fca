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
from service.web.access import RowNumber, SignInNeeded, build_actor, build_not_found
from service.web.context import Context

#: Describes the authentication in the OpenAPI document. ``require_caller`` checks the token.
bearer = HTTPBearer(auto_error=False, description="A token from `/account` or `robomark user token`.")


@dataclass(frozen=True, slots=True)
class Caller:
    """The owner of a token."""

    identity: Identity

    @property
    def actor(self) -> Actor:
        """Return the caller as an actor for operations."""
        return build_actor(self.identity)


@dataclass(frozen=True, slots=True)
class CallerInCourse:
    """The owner of a token in a course in which they have a role."""

    caller: Caller
    course_id: int

    @property
    def actor(self) -> Actor:
        """Return the caller as an actor for operations."""
        return self.caller.actor


def require_caller(request: Request, context: Context) -> Caller:
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
        sign_in.record_use(context.service, identity)
    return Caller(identity)


def _require_caller(request: Request, context: Context, _credentials: Annotated[object, Depends(bearer)]) -> Caller:
    return require_caller(request, context)


AuthenticatedCaller = Annotated[Caller, Depends(_require_caller)]


def require_scope(scope: str) -> Callable[[Caller], Caller]:
    """Return a dependency that requires a token scope. Use as ``Depends(with_scope("read"))``."""
    assert scope in SCOPES

    def caller(caller: AuthenticatedCaller) -> Caller:
        if caller.identity.scopes is None or scope not in caller.identity.scopes:
            raise HTTPException(403, f"This token does not have the scope {scope}.")
        return caller

    return caller


def require_role(role: Role, scope: str) -> Callable[[int, Caller, Context], CallerInCourse]:
    """Return a dependency that requires a role in the path's course and a token scope."""
    require_scoped_caller = require_scope(scope)

    def caller_in_course(course_id: RowNumber, caller: AuthenticatedCaller, context: Context) -> CallerInCourse:
        course = courses.show_own(context.service, caller.actor, course_id, role)
        return CallerInCourse(require_scoped_caller(caller), course.id)

    return caller_in_course


def require_member(scope: str) -> Callable[[int, Caller, Context], CallerInCourse]:
    """Return a dependency that requires any role in the path's course and a token scope."""
    require_scoped_caller = require_scope(scope)

    def member(course_id: RowNumber, caller: AuthenticatedCaller, context: Context) -> CallerInCourse:
        course = courses.show_membership(context.service, caller.actor, course_id)
        return CallerInCourse(require_scoped_caller(caller), course.id)

    return member


def require_operator(scope: str) -> Callable[[Caller], Caller]:
    """Return a dependency that requires an operator and a token scope."""
    require_scoped_caller = require_scope(scope)

    def operator(caller: AuthenticatedCaller) -> Caller:
        if not caller.identity.operator:
            raise build_not_found()
        return require_scoped_caller(caller)

    return operator
