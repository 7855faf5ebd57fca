"""Limits of request bodies: senders are checked before the body is read, and only uploads may be large.

This is plain ASGI middleware, because FastAPI reads the body before it checks the sender. The routes check roles again;
the check here only avoids reading uploads that the route would reject.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TypeVar

from fastapi import Request
from fastapi.concurrency import run_in_threadpool
from fastapi.routing import iter_route_contexts
from fastapi.security.utils import get_authorization_scheme_param
from python_multipart.multipart import parse_options_header
from starlette.datastructures import Headers
from starlette.routing import compile_path
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from service.operations import sign_in
from service.operations.sign_in import Identity
from service.operations.types import CredentialKind, Role
from service.web.access import SESSION_COOKIE, SignInNeeded, build_not_found, find_course_role
from service.web.context import WebContext
from service.web.http_errors import TranslatableHTTPException
from service.web.problems import API_PREFIX
from sim.sentences import Sentence

MEGABYTE = 2**20
#: Maximum size of a form or JSON body, for routes that declare no upload.
MAX_FORM_BYTES = MEGABYTE
#: Maximum size for public routes: sign-in links and launches by learning platforms.
_MAX_PUBLIC_BODY_BYTES = 128 * 1024
_PUBLIC_PATHS = frozenset({"/sign-in", "/language", "/lti/login", "/lti/launch"})
_BODILESS_METHODS = frozenset({"GET", "HEAD", "OPTIONS", "TRACE"})
_UPLOAD_ATTRIBUTE = "robomark_upload"
_Endpoint = TypeVar("_Endpoint", bound=Callable[..., object])


class BodyTooLarge(TranslatableHTTPException):
    """The request body is too large."""

    def __init__(self, max_bytes: int) -> None:
        amount = f"{max_bytes // MEGABYTE} MB" if max_bytes >= MEGABYTE else f"{max_bytes // 1024} kB"
        super().__init__(413, Sentence("The request is too large. The limit is %(limit)s.", limit=amount))


@dataclass(frozen=True, slots=True)
class UploadLimit:
    """The maximum size in bytes of a route's upload, and the course roles that may send it."""

    most: int
    roles: tuple[Role, ...]


def takes_upload(max_bytes: int, *roles: Role) -> Callable[[_Endpoint], _Endpoint]:
    """Declare that an endpoint accepts bodies of up to ``max_bytes`` bytes. All others accept ``MAX_FORM_BYTES``."""

    def declared(endpoint: _Endpoint) -> _Endpoint:
        setattr(endpoint, _UPLOAD_ATTRIBUTE, UploadLimit(max_bytes, roles))
        return endpoint

    return declared


@dataclass(frozen=True, slots=True)
class _UploadRoute:
    path: re.Pattern[str]
    methods: frozenset[str]
    upload: UploadLimit


class BodyLimitMiddleware:
    """ASGI middleware that limits the size of bodies and rejects unknown senders."""

    def __init__(self, app: ASGIApp) -> None:
        self._app = app
        self._uploads: Sequence[_UploadRoute] | None = None

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Handle one ASGI request."""
        if scope["type"] != "http":
            await self._app(scope, receive, send)
            return
        upload, course = self._find_upload(scope)
        max_bytes = MAX_FORM_BYTES if upload is None else upload.most
        if scope["path"] in _PUBLIC_PATHS:
            max_bytes = _MAX_PUBLIC_BODY_BYTES
        request = Request(scope, receive)
        try:
            if scope["method"] not in _BODILESS_METHODS and scope["path"] not in _PUBLIC_PATHS:
                await run_in_threadpool(_check_sender, request, upload, course)
            _check_charset(request.headers)
            _check_length(request.headers, max_bytes)
        except Exception as error:
            handlers = scope["app"].exception_handlers
            handler = next(handlers[kind] for kind in type(error).__mro__ if kind in handlers)
            answer = await handler(request, error)
            await answer(scope, receive, send)
            return
        await self._app(scope, _limit_body(receive, max_bytes), send)

    def _find_upload(self, scope: Scope) -> tuple[UploadLimit | None, str]:
        """Return the upload that the request's route declares, and the course id in the path."""
        if self._uploads is None:
            self._uploads = tuple(
                _UploadRoute(compile_path(route.path)[0], frozenset(route.methods or ()), upload)
                for route in iter_route_contexts(scope["app"].routes)
                if (upload := getattr(route.endpoint, _UPLOAD_ATTRIBUTE, None)) is not None and route.path is not None
            )
        for route in self._uploads:
            if scope["method"] in route.methods and (match := route.path.match(scope["path"])):
                return route.upload, match["course_id"]
        return None, ""


def _check_sender(request: Request, upload: UploadLimit | None, course: str) -> None:
    """Raise the exception that the route would raise for this sender."""
    identity = _find_identity(request)
    if identity is None:
        raise SignInNeeded("sign in first")
    if upload is not None and find_course_role(identity, course) not in upload.roles:
        raise build_not_found()


def _find_identity(request: Request) -> Identity | None:
    context: WebContext = request.app.state.context
    if request.url.path.startswith(API_PREFIX):
        scheme, secret = get_authorization_scheme_param(request.headers.get("authorization"))
        kind = CredentialKind.TOKEN
        secret = secret if scheme.lower() == "bearer" else ""
    else:
        secret, kind = request.cookies.get(SESSION_COOKIE, ""), CredentialKind.SESSION
    if not secret:
        return None
    return sign_in.identify(context.service, secret, kind)


def _check_length(headers: Headers, max_bytes: int) -> None:
    length = headers.get("content-length", "0")
    if not length.isdecimal() or len(length) > 18 or int(length) > max_bytes:
        raise BodyTooLarge(max_bytes)


def _check_charset(headers: Headers) -> None:
    """Reject forms in another charset than UTF-8.

    The form parser decodes with any codec of Python, on the thread that serves all requests. Some take time
    proportional to the square of the length, others return text that cannot be encoded again.
    """
    kind, options = parse_options_header(headers.get("content-type"))
    if kind == b"multipart/form-data" and options.get(b"charset", b"utf-8").lower() not in (b"utf-8", b"utf8"):
        raise TranslatableHTTPException(415, Sentence("Forms are read in UTF-8 only."))


def _limit_body(receive: Receive, max_bytes: int) -> Receive:
    """Wrap ``receive`` and raise TooMuch when the body exceeds ``max_bytes`` bytes."""
    so_far = 0

    async def counted() -> Message:
        nonlocal so_far
        message = await receive()
        so_far += len(message.get("body", b""))
        if so_far > max_bytes:
            raise BodyTooLarge(max_bytes)
        return message

    return counted
