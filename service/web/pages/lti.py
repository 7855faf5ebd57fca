"""LTI launches from learning platforms: login, launch, and this installation's public keys.

Platforms post from their own sites, so these routes check no CSRF token. The state, the nonce and the platform's
signature protect a launch.
"""

from __future__ import annotations

import hmac
from typing import Annotated, Any

from fastapi import APIRouter, Form, Query, Request
from fastapi.responses import RedirectResponse, Response

from service.operations import launches
from service.operations.launches import LaunchRequest, UnknownPlatform
from service.web.context import Context, WebContext
from service.web.pages.home import build_course_path
from service.web.pages.sign_in import sanitize_target, set_session_cookie
from sim.errors import UsageError

cross_site_router = APIRouter()
#: Binds a launch to the browser that started it. The cookie is also sent on the platform's cross-site request.
_STATE_COOKIE = "robomark_launch"
_MAX_PARAMETER_LENGTH = 4000

Text = Annotated[str, Form(max_length=_MAX_PARAMETER_LENGTH)]


@cross_site_router.get("/lti/keys")
def list_keys(context: Context) -> dict[str, Any]:
    """Return the public keys of this installation."""
    return launches.list_keys(context.service)


@cross_site_router.get("/lti/login")
def login_by_link(
    request: Request,
    context: Context,
    iss: Annotated[str, Query(max_length=_MAX_PARAMETER_LENGTH)],
    login_hint: Annotated[str, Query(max_length=_MAX_PARAMETER_LENGTH)],
    target_link_uri: Annotated[str, Query(max_length=_MAX_PARAMETER_LENGTH)] = "",
    lti_message_hint: Annotated[str, Query(max_length=_MAX_PARAMETER_LENGTH)] = "",
    client_id: Annotated[str, Query(max_length=_MAX_PARAMETER_LENGTH)] = "",
) -> Response:
    """Start a launch from a link."""
    return _begin_launch(request, context, iss, login_hint, target_link_uri, lti_message_hint, client_id)


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
    """Start a launch from a form."""
    return _begin_launch(request, context, iss, login_hint, target_link_uri, lti_message_hint, client_id)


@cross_site_router.post("/lti/launch")
def complete_launch(
    request: Request,
    context: Context,
    state: Text = "",
    id_token: Annotated[str, Form(max_length=50_000)] = "",
    error: Text = "",
    error_description: Text = "",
) -> Response:
    """Complete a launch: sign the user in and redirect to their course."""
    if error:
        raise UsageError(f"the platform refused the launch: {(error_description or error)[:200]}")
    stored_state = request.cookies.get(_STATE_COOKIE, "")
    if not stored_state or not hmac.compare_digest(stored_state.encode(), state.encode()):
        raise UsageError("this launch started in another browser or has expired; open the link in the course again")
    launch = launches.complete(context.service, state, id_token)
    target = (
        launch.target if launch.target != "/" else build_course_path(launch.launched.course_id, launch.launched.role)
    )
    answer = RedirectResponse(target, 303)
    set_session_cookie(answer, context, launch.session)
    answer.delete_cookie(_STATE_COOKIE, path="/lti", secure=True, httponly=True, samesite="none")
    return answer


def _begin_launch(
    request: Request,
    context: WebContext,
    issuer: str,
    login_hint: str,
    target: str,
    message_hint: str,
    client_id: str,
) -> Response:
    site_url = context.settings.public_url or str(request.base_url).rstrip("/")
    # Accept only local paths, so that the link's author cannot redirect to another site.
    path = sanitize_target(target.removeprefix(site_url)) if target.startswith(f"{site_url}/") else "/"
    try:
        launch = launches.begin(
            context.service, LaunchRequest(issuer, client_id, login_hint, message_hint, site_url, path)
        )
    except UnknownPlatform:
        context.limits.unknown_platforms.spend("" if request.client is None else request.client.host)
        raise
    answer = RedirectResponse(launch.authorization_address, 303)
    answer.set_cookie(
        _STATE_COOKIE, launch.state, max_age=600, path="/lti", httponly=True, samesite="none", secure=True
    )
    return answer
