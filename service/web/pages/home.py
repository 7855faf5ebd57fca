"""The home page with a person's courses, and the account page with their sessions and tokens."""

from __future__ import annotations

from typing import Annotated
from urllib.parse import quote

from fastapi import APIRouter, Form, Query, Request
from fastapi.responses import RedirectResponse, Response

from service.operations import courses
from service.operations import credentials as own_credentials
from service.operations.credentials import TokenRequest
from service.operations.scopes import list_offered_scopes
from service.operations.types import CredentialKind, Role
from service.web.access import RowName, SignedInReader
from service.web.context import Context
from service.web.created_links import derive_secret, generate_word
from service.web.rendering import render_page

router = APIRouter()

#: The word in the page's address that the new token is derived from; empty if no token is shown.
TokenWord = Annotated[str, Query(max_length=64)]


@router.get("/")
def show_home(request: Request, reader: SignedInReader, context: Context) -> Response:
    """Show the reader's courses, or redirect to the only one."""
    own_courses = sorted(courses.list_own(context.service, reader.actor), key=lambda each: each.name)
    if len(own_courses) == 1 and not reader.identity.operator:
        return RedirectResponse(build_course_path(own_courses[0].id, own_courses[0].role), 303)
    course_links = [(each.name, each.role, build_course_path(each.id, each.role)) for each in own_courses]
    return render_page(request, reader, "home.html", courses=course_links)


@router.get("/account")
def show_account(request: Request, reader: SignedInReader, context: Context, made: TokenWord = "") -> Response:
    """Show the reader's name, sessions and tokens. A new token can be copied until its first use."""
    identity = reader.identity
    lines = own_credentials.list_credentials(context.service, reader.actor)
    word = derive_secret(reader, made)
    secret = own_credentials.show_unused_token(context.service, reader.actor, word) if made else ""
    return render_page(
        request,
        reader,
        "account.html",
        tokens=[each for each in lines if each.kind is CredentialKind.TOKEN],
        sessions=[each for each in lines if each.kind is CredentialKind.SESSION],
        scopes=list_offered_scopes(identity.roles.values(), operator=identity.operator, limit=identity.scopes),
        new_token=secret,
        word=generate_word(),
    )


@router.post("/account/tokens")
def make_token(
    reader: SignedInReader,
    context: Context,
    word: Annotated[str, Form(min_length=1, max_length=64)],
    name: Annotated[str, Form(min_length=1, max_length=100)],
    days: Annotated[int, Form(ge=1, le=366)] = 90,
    scopes: Annotated[tuple[str, ...], Form()] = (),
) -> Response:
    """Create a token. Sending the same form twice creates only one."""
    token_request = TokenRequest(name, frozenset(scopes), days, derive_secret(reader, word))
    own_credentials.make_token(context.service, reader.actor, token_request)
    return RedirectResponse(f"/account?made={quote(word)}", 303)


@router.post("/account/tokens/{token_id}/revoke")
def revoke_token(reader: SignedInReader, context: Context, token_id: RowName) -> Response:
    """Revoke one of the reader's tokens."""
    own_credentials.end_credential(context.service, reader.actor, token_id)
    return RedirectResponse("/account", 303)


@router.post("/account/sessions/{session_id}/end")
def end_session(reader: SignedInReader, context: Context, session_id: RowName) -> Response:
    """End one of the reader's sessions."""
    own_credentials.end_credential(context.service, reader.actor, session_id)
    return RedirectResponse("/account", 303)


@router.post("/account/end-others")
def end_others(reader: SignedInReader, context: Context) -> Response:
    """End all links, sessions and tokens of the reader except this session."""
    own_credentials.end_other_credentials(context.service, reader.actor)
    return RedirectResponse("/account", 303)


def build_course_path(course_id: int, role: Role) -> str:
    """Return the path of a course's first page for this role."""
    return f"/courses/{course_id}/batches" if role is Role.INSTRUCTOR else f"/courses/{course_id}/mine"
