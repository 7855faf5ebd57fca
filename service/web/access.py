"""Access control for pages: the dependencies that identify the reader and check their role.

All routes except a few public ones use one of them. A reader without the role gets 404, so that responses don't reveal
which objects exist. ``reports/view.py`` decides which parts of a grade a reader may see.
"""

from __future__ import annotations

import hmac
import re
import secrets
from dataclasses import dataclass, field
from typing import Annotated

from fastapi import Depends, Form, Path, Query, Request
from starlette.exceptions import HTTPException

from service.language import translatable
from service.operations import courses, sign_in
from service.operations.context import Actor
from service.operations.sign_in import Identity
from service.operations.types import CredentialKind, Role
from service.web.context import Context
from sim.errors import RobomarkError

SESSION_COOKIE = "robomark"
CSRF_FIELD = "csrf"
CSRF_HEADER = "x-csrf-token"
_SAFE_METHODS = frozenset({"GET", "HEAD", "OPTIONS"})
#: Pages that every session may open, and signing out.
_FOR_EVERY_SESSION = frozenset({"GET /", "GET /account", "POST /sign-out"})
#: Scopes of routes that change something, by a pattern in the route. The first match counts.
_CHANGES = (
    (re.compile(r"^/account/"), "sign-in"),
    (re.compile(r"/worksheet$"), "read"),
    (re.compile(r"/(grades|appeals)/|/(publish|regrade)$"), "mark"),
    (re.compile(r"^/operator|/(assignments|people|platform|policy)(/|$)"), "manage"),
    (re.compile(""), "submit"),
)
#: Row numbers and names in paths, queries and forms, limited to values that every database accepts.
HIGHEST_NUMBER = 2**31 - 1
RowNumber = Annotated[int, Path(ge=1, le=HIGHEST_NUMBER)]
RowName = Annotated[str, Path(pattern="^[0-9a-z]{1,32}$")]
RowNumberAfter = Annotated[int, Query(ge=0, le=HIGHEST_NUMBER)]
RowNameAfter = Annotated[str, Query(pattern="^[0-9a-z]{0,32}$")]
SentRowNumber = Annotated[int, Form(ge=0, le=HIGHEST_NUMBER)]
SentRowName = Annotated[str, Form(pattern="^[0-9a-z]{0,32}$")]


class SignInNeeded(RobomarkError):
    """The request needs a signed-in user."""


@dataclass(frozen=True, slots=True)
class Reader:
    """A user who is signed in with a browser, and keys derived from their session."""

    identity: Identity
    csrf: str  # the CSRF token of their forms
    link_key: bytes = field(repr=False)  # key for deriving the links that they create for others

    @property
    def actor(self) -> Actor:
        """Return the reader as an actor for operations."""
        return build_actor(self.identity)


@dataclass(frozen=True, slots=True)
class ReaderInCourse:
    """A reader with a role in a course."""

    reader: Reader
    course_id: int
    course: str  # the course's name
    appeals: int = 0  # number of open appeals, for instructors

    @property
    def actor(self) -> Actor:
        """Return the reader as an actor for operations."""
        return self.reader.actor


def build_actor(identity: Identity) -> Actor:
    """Return the actor for a signed-in person."""
    return Actor(
        f"{identity.name} (person {identity.person_id})",
        identity.person_id,
        identity.operator,
        identity.roles,
        identity.reach,
        identity.credential_id,
    )


def find_course_role(identity: Identity, course: str) -> Role | None:
    """Return the role in the course with this id, as written in a path; None without one, or for any other text."""
    # Python rejects integers with thousands of digits.
    is_number = course.isdecimal() and len(course) <= len(str(HIGHEST_NUMBER))
    return identity.roles.get(int(course)) if is_number else None


def derive_csrf_token(session_secret: str) -> str:
    """Return the CSRF token for a session. It does not reveal the session's secret."""
    return _derive_key(session_secret, b"robomark csrf").hex()


def _derive_key(session_secret: str, purpose: bytes) -> bytes:
    return hmac.digest(session_secret.encode(), purpose, "sha256")


def find_reader(request: Request, context: Context) -> Reader | None:
    """Return the signed-in reader, or None."""
    secret = request.cookies.get(SESSION_COOKIE, "")
    if not secret:
        return None
    identity = sign_in.identify(context.service, secret, CredentialKind.SESSION)
    return (
        None
        if identity is None
        else Reader(identity, derive_csrf_token(secret), _derive_key(secret, b"robomark links"))
    )


OptionalReader = Annotated[Reader | None, Depends(find_reader)]


def _require_sign_in(request: Request, reader: OptionalReader, context: Context) -> Reader:
    if reader is None:
        raise SignInNeeded("sign in first")
    context.limits.page_calls.spend(str(reader.identity.person_id))
    required_scope = find_page_scope(request.method, request.scope["route"].path)
    if (
        reader.identity.scopes is not None
        and required_scope is not None
        and required_scope not in reader.identity.scopes
    ):
        raise HTTPException(
            403,
            translatable("Your sign-in token does not have the scope for this action. Use another token or a link."),
        )
    return reader


SignedInReader = Annotated[Reader, Depends(_require_sign_in)]


async def check_same_site(request: Request, reader: OptionalReader) -> None:
    """Reject changes that other sites send, by the CSRF token and the browser's origin headers.

    Raises:
        HTTPException: 403 if the request comes from another site or its CSRF token is wrong.
    """
    if request.method in _SAFE_METHODS:
        return
    if not _is_same_origin(request):
        raise HTTPException(
            403, translatable("This request came from another website. Open the page in Robomark, and try again.")
        )
    if reader is None:
        return
    csrf_token = request.headers.get(CSRF_HEADER)
    if csrf_token is None:
        csrf_token = str((await request.form()).get(CSRF_FIELD, ""))
    if not secrets.compare_digest(csrf_token.encode(), reader.csrf.encode()):
        raise HTTPException(
            403,
            translatable(
                "The page has expired, or the request came from another website. Reload the page, and try again."
            ),
        )


def _is_same_origin(request: Request) -> bool:
    """Return whether the browser reports this site as the request's origin.

    Older browsers send only ``Origin``. Clients that send neither header are accepted.
    """
    site = request.headers.get("sec-fetch-site")
    if site is not None:
        return site in ("same-origin", "none")
    origin = request.headers.get("origin")
    if origin is None:
        return True
    public_url = request.app.state.context.settings.public_url
    host = request.headers.get("host", "").lower()
    return origin.lower() in {public_url.lower(), f"http://{host}", f"https://{host}"} - {""}


def build_not_found() -> HTTPException:
    """Return the 404 response for objects that do not exist or that the reader may not see."""
    return HTTPException(404, translatable("There is no such page or item, or you have no access to it."))


def _require_instructor(course_id: RowNumber, reader: SignedInReader, context: Context) -> ReaderInCourse:
    course = courses.show_taught(context.service, reader.actor, course_id)
    return ReaderInCourse(reader, course.id, course.name, course.open_appeals)


def _require_student(course_id: RowNumber, reader: SignedInReader, context: Context) -> ReaderInCourse:
    course = courses.show_own(context.service, reader.actor, course_id, Role.STUDENT)
    return ReaderInCourse(reader, course.id, course.name)


def _require_member(course_id: RowNumber, reader: SignedInReader, context: Context) -> ReaderInCourse:
    is_instructor = reader.identity.roles.get(course_id) is Role.INSTRUCTOR
    return (_require_instructor if is_instructor else _require_student)(course_id, reader, context)


def _require_operator(reader: SignedInReader) -> Reader:
    if not reader.identity.operator:
        raise build_not_found()
    return reader


#: An instructor of the course in the path, a student of it, either of them, and an operator.
CourseInstructor = Annotated[ReaderInCourse, Depends(_require_instructor)]
CourseStudent = Annotated[ReaderInCourse, Depends(_require_student)]
CourseMember = Annotated[ReaderInCourse, Depends(_require_member)]
OperatorReader = Annotated[Reader, Depends(_require_operator)]


def find_page_scope(method: str, route: str) -> str | None:
    """Return the scope for a method and a route such as ``/courses/{course_id}/batches``, or None if none is needed."""
    if f"{method} {route}" in _FOR_EVERY_SESSION:
        return None
    if method in ("GET", "HEAD"):
        return "read"
    return next(scope for pattern, scope in _CHANGES if pattern.search(route))
