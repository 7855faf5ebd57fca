"""Access control for pages: the dependencies that identify the reader and check their role.

All routes except a few public ones use one of them. A reader without the role gets 404, so that responses don't reveal
which objects exist. ``reports/view.py`` decides which parts of a grade a reader may see.
"""

from __future__ import annotations

import hmac
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
from service.web.page_scopes import scope_of_page
from sim.errors import RobomarkError

SESSION_COOKIE = "robomark"
CSRF_FIELD = "csrf"
CSRF_HEADER = "x-csrf-token"
_SAFE = frozenset({"GET", "HEAD", "OPTIONS"})
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
    def acting(self) -> Actor:
        """Return the reader as an actor for operations."""
        return actor_from(self.identity)


@dataclass(frozen=True, slots=True)
class InCourse:
    """A reader with a role in a course."""

    reader: Reader
    course_id: int
    course: str  # the course's name
    appeals: int = 0  # number of open appeals, for instructors

    @property
    def acting(self) -> Actor:
        """Return the reader as an actor for operations."""
        return self.reader.acting


def actor_from(identity: Identity) -> Actor:
    """Return the actor for a signed-in person."""
    return Actor(
        f"{identity.name} (person {identity.person_id})",
        identity.person_id,
        identity.operator,
        identity.roles,
        identity.reach,
        identity.credential_id,
    )


def csrf_word(session_secret: str) -> str:
    """Return the CSRF token for a session. It does not reveal the session's secret."""
    return _following(session_secret, b"robomark csrf").hex()


def _following(session_secret: str, what: bytes) -> bytes:
    return hmac.digest(session_secret.encode(), what, "sha256")


def reader_of(request: Request, context: Context) -> Reader | None:
    """Return the signed-in reader, or None."""
    secret = request.cookies.get(SESSION_COOKIE, "")
    if not secret:
        return None
    identity = sign_in.identify(context.service, secret, CredentialKind.SESSION)
    return None if identity is None else Reader(identity, csrf_word(secret), _following(secret, b"robomark links"))


MaybeReader = Annotated[Reader | None, Depends(reader_of)]


def _signed_in(request: Request, reader: MaybeReader, context: Context) -> Reader:
    if reader is None:
        raise SignInNeeded("sign in first")
    context.limits.page_calls.spend(str(reader.identity.person_id))
    needed = scope_of_page(request.method, request.scope["route"].path)
    if reader.identity.scopes is not None and needed is not None and needed not in reader.identity.scopes:
        raise HTTPException(
            403,
            translatable("Your sign-in token does not have the scope for this action. Use another token or a link."),
        )
    return reader


SignedIn = Annotated[Reader, Depends(_signed_in)]


async def same_site(request: Request, reader: MaybeReader) -> None:
    """Reject changes that other sites send, by the CSRF token and the browser's origin headers.

    Raises:
        HTTPException: 403 if the request comes from another site or its CSRF token is wrong.
    """
    if request.method in _SAFE:
        return
    if not _is_from_here(request):
        raise HTTPException(
            403, translatable("This request came from another website. Open the page in Robomark, and try again.")
        )
    if reader is None:
        return
    word = request.headers.get(CSRF_HEADER)
    if word is None:
        word = str((await request.form()).get(CSRF_FIELD, ""))
    if not secrets.compare_digest(word.encode(), reader.csrf.encode()):
        raise HTTPException(
            403,
            translatable(
                "The page has expired, or the request came from another website. Reload the page, and try again."
            ),
        )


def _is_from_here(request: Request) -> bool:
    """Return whether the browser reports this site as the request's origin.

    Older browsers send only ``Origin``. Clients that send neither header are accepted.
    """
    site = request.headers.get("sec-fetch-site")
    if site is not None:
        return site in ("same-origin", "none")
    origin = request.headers.get("origin")
    if origin is None:
        return True
    public = request.app.state.context.settings.public_url
    here = request.headers.get("host", "").lower()
    return origin.lower() in {public.lower(), f"http://{here}", f"https://{here}"} - {""}


def nothing_here() -> HTTPException:
    """Return the 404 response for objects that do not exist or that the reader may not see."""
    return HTTPException(404, translatable("There is no such page or item, or you have no access to it."))


def _instructing(course_id: RowNumber, reader: SignedIn, context: Context) -> InCourse:
    course = courses.show_taught(context.service, reader.acting, course_id)
    return InCourse(reader, course.id, course.name, course.open_appeals)


def _studying(course_id: RowNumber, reader: SignedIn, context: Context) -> InCourse:
    course = courses.show_own(context.service, reader.acting, course_id, Role.STUDENT)
    return InCourse(reader, course.id, course.name)


def _operating(reader: SignedIn) -> Reader:
    if not reader.identity.operator:
        raise nothing_here()
    return reader


#: An instructor of the course in the path, a student of it, and an operator.
Instructing = Annotated[InCourse, Depends(_instructing)]
Studying = Annotated[InCourse, Depends(_studying)]
Operating = Annotated[Reader, Depends(_operating)]
