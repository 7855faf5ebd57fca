"""The first page: the courses that somebody has a role in; and one's own account with its tokens."""

from __future__ import annotations

from datetime import timedelta
from typing import Annotated
from urllib.parse import quote

from fastapi import APIRouter, Form, Query, Request
from fastapi.responses import RedirectResponse, Response
from sqlalchemy import select

from service.store.models import Course
from service.store.people import credentials
from service.store.states import Role
from service.web.access import SignedIn, nothing_here
from service.web.api_scopes import SCOPES
from service.web.context import Context
from service.web.made_links import new_word, secret_word
from service.web.refusing import Declined
from service.web.rendering import page
from sim.sentences import Sentence

router = APIRouter()

#: The word in an address that a token was made of; empty where none is shown.
MadeWord = Annotated[str, Query(max_length=64)]


@router.get("/")
def home(request: Request, reader: SignedIn, context: Context) -> Response:
    """One's courses; where there is but one thing to see, that."""
    roles = reader.identity.roles
    with context.store.reading() as session:
        rows = session.scalars(select(Course).where(Course.id.in_(roles)).order_by(Course.name)).all()
    if len(rows) == 1 and not reader.identity.operator:
        return RedirectResponse(course_path(rows[0].id, roles[rows[0].id]), 303)
    listed = [(row.name, roles[row.id], course_path(row.id, roles[row.id])) for row in rows]
    return page(request, reader, "home.html", courses=listed)


@router.get("/account")
def account(request: Request, reader: SignedIn, context: Context, made: MadeWord = "") -> Response:
    """One's name and tokens; the one just made can be copied until it is used."""
    person_id = reader.identity.person_id
    with context.store.reading() as session:
        tokens = credentials.tokens(session, person_id)
        secret = credentials.unused_token(session, person_id, secret_word(reader, made)) if made else ""
    return page(request, reader, "account.html", tokens=tokens, scopes=SCOPES, made=secret, word=new_word())


@router.post("/account/tokens")
def make_token(
    reader: SignedIn,
    context: Context,
    word: Annotated[str, Form(min_length=1, max_length=64)],
    name: Annotated[str, Form(min_length=1, max_length=100)],
    days: Annotated[int, Form(ge=1, le=366)] = 90,
    scopes: Annotated[tuple[str, ...], Form()] = (),
) -> Response:
    """A new token; the form sent twice makes one."""
    if not scopes or not set(scopes) <= set(SCOPES):
        raise Declined(422, Sentence("Say what the token may do: %(scopes)s.", {"scopes": ", ".join(SCOPES)}))
    person_id, lifetime, secret = reader.identity.person_id, timedelta(days=days), secret_word(reader, word)
    with context.store.transaction() as session:
        credentials.make_token(session, person_id, lifetime, secret, name=name, scopes=scopes)
    return RedirectResponse(f"/account?made={quote(word)}", 303)


@router.post("/account/tokens/{token_id}/revoke")
def revoke_token(reader: SignedIn, context: Context, token_id: str) -> Response:
    """Let a token count no more."""
    with context.store.transaction() as session:
        if not credentials.revoke(session, token_id, reader.identity.person_id):
            raise nothing_here()
    return RedirectResponse("/account", 303)


def course_path(course_id: int, role: Role) -> str:
    """Where somebody's course begins."""
    return f"/courses/{course_id}/batches" if role is Role.INSTRUCTOR else f"/courses/{course_id}/mine"
