"""Which request bodies are read: who sends one is known by its headers first, and only declared uploads are long.

Plain ASGI in front of FastAPI, which reads and parses a body before it asks who sends it. Roles are checked again by
the route; here they keep an upload from being read that its route would refuse.
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
from starlette.datastructures import Headers
from starlette.exceptions import HTTPException
from starlette.routing import compile_path
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from service.operations import sign_in
from service.operations.sign_in import Identity
from service.operations.types import CredentialKind, Role
from service.web.access import SESSION_COOKIE, SignInNeeded, nothing_here
from service.web.context import WebContext
from service.web.problems import API

MEGABYTE = 2**20
#: Of a request whose route declares no upload: a form or JSON.
LARGEST_FORM = MEGABYTE
#: Of those that anybody may send: a sign-in link, or a learning platform's word of who comes.
_LARGEST_OF_ANYBODY = 128 * 1024
_FOR_ANYBODY = frozenset({"/sign-in", "/language", "/lti/login", "/lti/launch"})
_WITHOUT_BODY = frozenset({"GET", "HEAD", "OPTIONS", "TRACE"})
_MARK = "robomark_upload"
_Endpoint = TypeVar("_Endpoint", bound=Callable[..., object])


class TooMuch(HTTPException):
    """A body was longer than is read."""

    def __init__(self, most: int) -> None:
        amount = f"{most // MEGABYTE} MB" if most >= MEGABYTE else f"{most // 1024} kB"
        super().__init__(413, f"This is too much: at most {amount} are read.")


@dataclass(frozen=True, slots=True)
class Upload:
    """How many bytes a route takes, and from whom in its course."""

    most: int
    role: Role


def takes_upload(most: int, role: Role) -> Callable[[_Endpoint], _Endpoint]:
    """Declare that the endpoint takes a body of up to ``most`` bytes. Every other endpoint takes ``LARGEST_FORM``."""

    def declared(endpoint: _Endpoint) -> _Endpoint:
        setattr(endpoint, _MARK, Upload(most, role))
        return endpoint

    return declared


@dataclass(frozen=True, slots=True)
class _UploadRoute:
    path: re.Pattern[str]
    methods: frozenset[str]
    upload: Upload


class BodyGate:
    """An application whose bodies are read up to their bounds, and of known senders alone."""

    def __init__(self, app: ASGIApp) -> None:
        self._app = app
        self._uploads: Sequence[_UploadRoute] | None = None

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Answer one request, as ASGI has it."""
        if scope["type"] != "http":
            await self._app(scope, receive, send)
            return
        upload, course = self._upload(scope)
        most = LARGEST_FORM if upload is None else upload.most
        if scope["path"] in _FOR_ANYBODY:
            most = _LARGEST_OF_ANYBODY
        request = Request(scope, receive)
        try:
            if scope["method"] not in _WITHOUT_BODY and scope["path"] not in _FOR_ANYBODY:
                await run_in_threadpool(_check_sender, request, upload, course)
            _check_length(Headers(scope=scope), most)
        except Exception as error:
            handlers = scope["app"].exception_handlers
            handler = next(handlers[kind] for kind in type(error).__mro__ if kind in handlers)
            answer = await handler(request, error)
            await answer(scope, receive, send)
            return
        await self._app(scope, _counted(receive, most), send)

    def _upload(self, scope: Scope) -> tuple[Upload | None, str]:
        """The upload that the request's route declares, and the course in its path."""
        if self._uploads is None:
            self._uploads = tuple(
                _UploadRoute(compile_path(route.path)[0], frozenset(route.methods or ()), upload)
                for route in iter_route_contexts(scope["app"].routes)
                if (upload := getattr(route.endpoint, _MARK, None)) is not None and route.path is not None
            )
        for route in self._uploads:
            if scope["method"] in route.methods and (found := route.path.match(scope["path"])):
                return route.upload, found["course_id"]
        return None, ""


def _check_sender(request: Request, upload: Upload | None, course: str) -> None:
    """Raise what the route would raise for this sender."""
    identity = _identity(request)
    if identity is None:
        raise SignInNeeded("who sends this is not known")
    if upload is not None and not (course.isdecimal() and identity.roles.get(int(course)) is upload.role):
        raise nothing_here()


def _identity(request: Request) -> Identity | None:
    context: WebContext = request.app.state.context
    if request.url.path.startswith(API):
        scheme, secret = get_authorization_scheme_param(request.headers.get("authorization"))
        kind = CredentialKind.TOKEN
        secret = secret if scheme.lower() == "bearer" else ""
    else:
        secret, kind = request.cookies.get(SESSION_COOKIE, ""), CredentialKind.SESSION
    if not secret:
        return None
    return sign_in.identify(context.service, secret, kind)


def _check_length(headers: Headers, most: int) -> None:
    length = headers.get("content-length", "0")
    if not length.isdecimal() or len(length) > 18 or int(length) > most:
        raise TooMuch(most)


def _counted(receive: Receive, most: int) -> Receive:
    """The body as it comes, until it is too much."""
    so_far = 0

    async def counted() -> Message:
        nonlocal so_far
        message = await receive()
        so_far += len(message.get("body", b""))
        if so_far > most:
            raise TooMuch(most)
        return message

    return counted
