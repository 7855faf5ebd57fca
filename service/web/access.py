"""Who asks, and what they may come near: every route but the few that are for anybody takes one of these.

Somebody without the role is told that there is nothing there, so that no answer tells what exists. What of a grade a
reader may see is ``reports/view.py``'s.
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
#: Numbers and names of rows in a path, a query or a form, within what every database can be asked for.
HIGHEST_NUMBER = 2**31 - 1
RowNumber = Annotated[int, Path(ge=1, le=HIGHEST_NUMBER)]
RowName = Annotated[str, Path(pattern="^[0-9a-z]{1,32}$")]
RowNumberAfter = Annotated[int, Query(ge=0, le=HIGHEST_NUMBER)]
RowNameAfter = Annotated[str, Query(pattern="^[0-9a-z]{0,32}$")]
SentRowNumber = Annotated[int, Form(ge=0, le=HIGHEST_NUMBER)]
SentRowName = Annotated[str, Form(pattern="^[0-9a-z]{0,32}$")]


class SignInNeeded(RobomarkError):
    """Nobody is signed in where somebody has to be."""


@dataclass(frozen=True, slots=True)
class Reader:
    """Somebody who is signed in with a browser, and what follows from their session alone."""

    identity: Identity
    csrf: str  # the word that their forms have to carry
    link_key: bytes = field(repr=False)  # what the links that they make for others follow from

    @property
    def acting(self) -> Actor:
        """The reader as operations know them."""
        return actor_from(self.identity)


@dataclass(frozen=True, slots=True)
class InCourse:
    """A reader in a course that they have a role in."""

    reader: Reader
    course_id: int
    course: str  # its name
    appeals: int = 0  # that wait for an instructor's answer

    @property
    def acting(self) -> Actor:
        """The reader as operations know them."""
        return self.reader.acting


def actor_from(identity: Identity) -> Actor:
    """The actor that operations know a signed-in person as."""
    return Actor(
        f"{identity.name} (person {identity.person_id})",
        identity.person_id,
        identity.operator,
        identity.roles,
        identity.reach,
        identity.credential_id,
    )


def csrf_word(session_secret: str) -> str:
    """What a form has to carry: it follows from the session, and the session does not follow from it."""
    return _following(session_secret, b"robomark csrf").hex()


def _following(session_secret: str, what: bytes) -> bytes:
    return hmac.digest(session_secret.encode(), what, "sha256")


def reader_of(request: Request, context: Context) -> Reader | None:
    """Who is signed in, if anybody is."""
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
        raise HTTPException(403, translatable("You signed in with a token whose scopes do not include this."))
    return reader


SignedIn = Annotated[Reader, Depends(_signed_in)]


async def same_site(request: Request, reader: MaybeReader) -> None:
    """What changes something has to come from a page of ours: by its word, and by what the browser says of itself."""
    if request.method in _SAFE:
        return
    if not _is_from_here(request):
        raise HTTPException(403, translatable("This came from another site; open the page here and send it again."))
    if reader is None:
        return
    word = request.headers.get(CSRF_HEADER)
    if word is None:
        word = str((await request.form()).get(CSRF_FIELD, ""))
    if not secrets.compare_digest(word.encode(), reader.csrf.encode()):
        raise HTTPException(
            403, translatable("This page was open for too long, or came from another site; load it and send again.")
        )


def _is_from_here(request: Request) -> bool:
    """Return what the browser says of where the request comes from; older ones send the origin alone, programs none."""
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
    """What is answered where there is nothing, or nothing for this reader."""
    return HTTPException(404, translatable("There is nothing here, or nothing that you may see."))


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


#: An instructor of the course in the path, a student of it, and who runs the installation.
Instructing = Annotated[InCourse, Depends(_instructing)]
Studying = Annotated[InCourse, Depends(_studying)]
Operating = Annotated[Reader, Depends(_operating)]
