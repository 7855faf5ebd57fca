"""Launches from learning platforms: their login, their word of who comes, and the keys that they know us by.

Platforms post here from their own pages, so no form's word is asked for: a launch counts by its state, its nonce and
the platform's signature.
"""

from __future__ import annotations

import hmac
from typing import Annotated, Any

from fastapi import APIRouter, Form, Query, Request
from fastapi.responses import RedirectResponse, Response

from service.lti import launch
from service.lti.keys import public_keys, signing_key
from service.store import audit
from service.store.people import credentials, lti
from service.store.people.credentials import SESSION_LIFETIME, Reach
from service.store.states import CredentialKind
from service.web.context import Context, WebContext
from service.web.pages.home import course_path
from service.web.pages.sign_in import inside, set_session
from sim.errors import UsageError

cross_site_router = APIRouter()
#: Binds a launch to the browser that began it. Platforms post from their own site, so it has to go along from there.
_STATE_COOKIE = "robomark_launch"
_LONGEST = 4000

Text = Annotated[str, Form(max_length=_LONGEST)]


@cross_site_router.get("/lti/keys")
def keys(context: Context) -> dict[str, Any]:
    """The public halves of our keys."""
    with context.store.transaction() as session:
        signing_key(session)
        return public_keys(session)


@cross_site_router.get("/lti/login")
def login_by_link(
    request: Request,
    context: Context,
    iss: Annotated[str, Query(max_length=_LONGEST)],
    login_hint: Annotated[str, Query(max_length=_LONGEST)],
    target_link_uri: Annotated[str, Query(max_length=_LONGEST)] = "",
    lti_message_hint: Annotated[str, Query(max_length=_LONGEST)] = "",
    client_id: Annotated[str, Query(max_length=_LONGEST)] = "",
) -> Response:
    """Where a platform begins a launch."""
    return _begin(request, context, iss, login_hint, target_link_uri, lti_message_hint, client_id)


@cross_site_router.post("/lti/login")
def login(
    request: Request,
    context: Context,
    iss: Text,
    login_hint: Text,
    target_link_uri: Text = "",
    lti_message_hint: Text = "",
    client_id: Text = "",
) -> Response:
    """Where a platform begins a launch, by a form."""
    return _begin(request, context, iss, login_hint, target_link_uri, lti_message_hint, client_id)


@cross_site_router.post("/lti/launch")
def end_launch(
    request: Request,
    context: Context,
    state: Text = "",
    id_token: Annotated[str, Form(max_length=50_000)] = "",
    error: Text = "",
    error_description: Text = "",
) -> Response:
    """Where a platform's word of who comes arrives; whoever comes is signed in and led to their course."""
    if error:
        raise UsageError(f"the platform refused the launch: {(error_description or error)[:200]}")
    began_here = request.cookies.get(_STATE_COOKIE, "")
    if not began_here or not hmac.compare_digest(began_here.encode(), state.encode()):
        raise UsageError("this launch was begun in another browser, or too long ago; open the link in the course again")
    with context.store.transaction() as session:
        pending = lti.take_launch(session, state)
    if pending is None:
        raise UsageError("this launch was begun too long ago, or used already; open the link in the course again")
    told = launch.read_launch(pending, id_token)
    with context.store.transaction() as session:
        launched = lti.meet(
            session,
            pending.platform,
            told.deployment,
            told.context,
            told.course_title,
            told.subject,
            told.student,
            told.role,
            told.members_url,
            told.lineitems_url,
        )
        if launched is None:
            raise UsageError("no instructor has opened Robomark from this course yet; ask yours to do it first")
        # A platform vouches for people in its own courses only.
        reach = Reach(platform_id=pending.platform.id)
        secret = credentials.issue(session, launched.person_id, CredentialKind.SESSION, SESSION_LIFETIME, reach=reach)
        audit.note(session, f"platform {pending.platform.name}", "launch", "person", str(launched.person_id))
    target = pending.target if pending.target != "/" else course_path(launched.course_id, launched.role)
    answer = RedirectResponse(target, 303)
    set_session(answer, context, secret)
    answer.delete_cookie(_STATE_COOKIE, path="/lti", secure=True, httponly=True, samesite="none")
    return answer


def _begin(
    request: Request,
    context: WebContext,
    issuer: str,
    login_hint: str,
    target: str,
    message_hint: str,
    client_id: str,
) -> Response:
    start = context.settings.public_url or str(request.base_url).rstrip("/")
    with context.store.reading() as session:
        platform = lti.find_platform(session, issuer, client_id or None)
    if platform is None:
        context.limits.unknown_platforms.spend("" if request.client is None else request.client.host)
        raise UsageError(f"no platform {issuer[:100]!r} with this client is registered here")
    # Only a path of ours: whoever makes the link does not choose another site.
    path = inside(target.removeprefix(start)) if target.startswith(f"{start}/") else "/"
    with context.store.transaction() as session:
        state, nonce = lti.begin_launch(session, platform, path)
    where = launch.authorization_address(platform, f"{start}/lti/launch", login_hint, message_hint, state, nonce)
    answer = RedirectResponse(where, 303)
    answer.set_cookie(_STATE_COOKIE, state, max_age=600, path="/lti", httponly=True, samesite="none", secure=True)
    return answer
