"""Signing in with a personal link or a token, signing out, and choosing the language."""

from __future__ import annotations

from typing import Annotated
from urllib.parse import urlsplit

from fastapi import APIRouter, Form, Query, Request
from fastapi.responses import RedirectResponse, Response
from starlette.exceptions import HTTPException

from service.language import list_languages, translatable
from service.operations import sign_in as operations
from service.operations.sign_in import NewSession
from service.web.access import SESSION_COOKIE, OptionalReader, SignedInReader
from service.web.context import Context, WebContext
from service.web.language import COOKIE as LANGUAGE_COOKIE
from service.web.rendering import render_page

router = APIRouter()
_INVALID_LINK = translatable("This link or token is invalid, expired or already used. Ask for a new one.")
_INVALID_LINK_SIGNED_IN = translatable("This link is invalid, expired or already used, but you are signed in.")


@router.get("/sign-in")
def show_sign_in(
    request: Request, reader: OptionalReader, target: Annotated[str, Query(alias="next")] = "/"
) -> Response:
    """Show the form for a sign-in link or a token."""
    return render_page(request, reader, "sign_in.html", target=sanitize_target(target), rejection="")


@router.get("/sign-in/{link}")
def show_link(request: Request, reader: OptionalReader, context: Context, link: str) -> Response:
    """Show the button that signs in with a personal link.

    Opening the page does not use up the link, because mail programs open links to check them.
    """
    owner = operations.find_link_owner(context.service, link)
    if owner is None:
        # Count only failures: a valid link always works, even after many failures from the same address.
        context.limits.failed_sign_ins.spend(_find_client_address(request))
        message = _INVALID_LINK if reader is None else _INVALID_LINK_SIGNED_IN
        return render_page(request, reader, "sign_in.html", status_code=410, target="/", rejection=message)
    return render_page(request, reader, "sign_in_link.html", link=link, name=owner.name)


@router.post("/sign-in")
def sign_in(
    request: Request,
    reader: OptionalReader,
    context: Context,
    secret: Annotated[str, Form(max_length=200)],
    target: Annotated[str, Form(alias="next")] = "/",
) -> Response:
    """Exchange a link's secret or a token for a session of this browser."""
    # Users may paste the whole link.
    secret = secret.strip().rstrip("/").rpartition("/")[2]
    new_session = operations.sign_in(context.service, None if reader is None else reader.actor, secret)
    if new_session is None:
        context.limits.failed_sign_ins.spend(_find_client_address(request))
        return render_page(
            request, reader, "sign_in.html", status_code=403, target=sanitize_target(target), rejection=_INVALID_LINK
        )
    answer = RedirectResponse(sanitize_target(target), 303)
    set_session_cookie(answer, context, new_session)
    return answer


@router.post("/sign-out")
def sign_out(reader: SignedInReader, context: Context) -> Response:
    """End the session of this browser."""
    operations.sign_out(context.service, reader.actor)
    answer = RedirectResponse("/sign-in", 303)
    answer.delete_cookie(SESSION_COOKIE, path="/")
    return answer


@router.post("/language")
def choose_language(
    code: Annotated[str, Form(max_length=20)], context: Context, target: Annotated[str, Form(alias="next")] = "/"
) -> Response:
    """Set the language of pages in this browser."""
    if code not in list_languages():
        raise HTTPException(422, translatable("This language is not available."))
    answer = RedirectResponse(sanitize_target(target), 303)
    answer.set_cookie(
        LANGUAGE_COOKIE, code, max_age=365 * 86_400, httponly=True, samesite="lax", secure=_is_secure(context)
    )
    return answer


def set_session_cookie(answer: Response, context: WebContext, new_session: NewSession) -> None:
    """Set the session cookie of the response, for the lifetime of the session."""
    seconds, is_secure = int(new_session.lifetime.total_seconds()), _is_secure(context)
    answer.set_cookie(
        SESSION_COOKIE, new_session.secret, max_age=seconds, path="/", httponly=True, samesite="lax", secure=is_secure
    )


def _is_secure(context: WebContext) -> bool:
    return context.settings.public_url.startswith("https:")


def _find_client_address(request: Request) -> str:
    return "" if request.client is None else request.client.host


def sanitize_target(target: str) -> str:
    """Return the redirect target if it is a local path, otherwise ``/``.

    Rejects backslashes and control characters, which browsers normalise.
    """
    try:
        parts = urlsplit(target)
    except ValueError:
        return "/"
    is_ours = target.startswith("/") and not target.startswith("//") and not parts.netloc and not parts.scheme
    return target if is_ours and "\\" not in target and target.isprintable() else "/"
