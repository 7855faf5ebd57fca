"""Who asks the API: a token whose owner has the role, and whose scopes name what is done. Cookies do not count here."""

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

#: Says in the description of the API how to sign in; who it is, is found below.
bearer = HTTPBearer(auto_error=False, description="A token of `/account` or of `robomark user token`.")


@dataclass(frozen=True, slots=True)
class Caller:
    """The owner of a token."""

    identity: Identity

    @property
    def acting(self) -> Actor:
        """The caller as operations know them."""
        return actor_from(self.identity)


@dataclass(frozen=True, slots=True)
class CallerInCourse:
    """The owner of a token in a course that they have a role in."""

    caller: Caller
    course_id: int

    @property
    def acting(self) -> Actor:
        """The caller as operations know them."""
        return self.caller.acting


def caller_of(request: Request, context: Context) -> Caller:
    """Whose token a request has. Raises SignInNeeded without one, HTTPException 429 where it comes too often."""
    scheme, secret = get_authorization_scheme_param(request.headers.get("authorization"))
    if scheme.lower() != "bearer" or not secret:
        raise SignInNeeded("a token is needed")
    identity = sign_in.identify(context.service, secret, CredentialKind.TOKEN)
    if identity is None:
        raise SignInNeeded("the token does not count")
    context.limits.api_calls.spend(identity.credential_id)
    if not identity.use_is_noted:
        sign_in.note_use(context.service, identity)
    return Caller(identity)


def _called(request: Request, context: Context, _told: Annotated[object, Depends(bearer)]) -> Caller:
    return caller_of(request, context)


Called = Annotated[Caller, Depends(_called)]


def with_scope(scope: str) -> Callable[[Caller], Caller]:
    """A dependency: the caller, where their token may do this. Use as ``Depends(with_scope("read"))``."""
    assert scope in SCOPES

    def caller(caller: Called) -> Caller:
        if caller.identity.scopes is None or scope not in caller.identity.scopes:
            raise HTTPException(403, f"This token may not do that: it lacks the scope {scope}.")
        return caller

    return caller


def in_course(role: Role, scope: str) -> Callable[[int, Caller, Context], CallerInCourse]:
    """A dependency: the caller with this role in the path's course, where their token may do this."""
    scoped = with_scope(scope)

    def caller_in_course(course_id: RowNumber, caller: Called, context: Context) -> CallerInCourse:
        course = courses.show_own(context.service, caller.acting, course_id, role)
        return CallerInCourse(scoped(caller), course.id)

    return caller_in_course


def operating(scope: str) -> Callable[[Caller], Caller]:
    """A dependency: the caller, where they run the installation and their token may do this."""
    scoped = with_scope(scope)

    def operator(caller: Called) -> Caller:
        if not caller.identity.operator:
            raise nothing_here()
        return scoped(caller)

    return operator
