"""What every route of the API has: it can be asked for again by a key, lists come in pages, answers have a tag.

What a route does is told in ``api/``; how the whole is described in ``api_description.py``.
"""

from __future__ import annotations

import base64
import hashlib
import json
from collections.abc import Awaitable, Callable, Mapping, Sequence
from datetime import UTC, datetime
from types import MappingProxyType
from typing import Annotated, Any, Generic, TypeVar

import structlog
from fastapi import APIRouter, Query, Request
from fastapi.concurrency import run_in_threadpool
from fastapi.responses import Response
from fastapi.routing import APIRoute
from pydantic import BaseModel, Field
from starlette.exceptions import HTTPException
from starlette.types import Message, Receive

from service.operations import replies
from service.operations.database_errors import DatabaseError
from service.operations.replies import InProgress, KeptReply
from service.operations.sign_in import Identity
from service.web.api_access import caller_of
from service.web.context import WebContext
from sim.readers.json_text import read_json
from sim.readers.unreadable import Unreadable

_log = structlog.get_logger(__name__)
KEY_HEADER = "idempotency-key"
LONGEST_KEY = 200
#: Lists, tables and their entries in the JSON of a body.
_MOST_VALUES = 20_000
#: For a route that takes no key: it changes nothing, or answers a secret that is to be kept nowhere.
NO_KEY: Mapping[str, Any] = MappingProxyType({"x-no-key": True})
_Item = TypeVar("_Item")
#: What a route can be answered, by status, as the description tells it.
Described = dict[int | str, dict[str, Any]]

Limit = Annotated[int, Query(ge=1, le=200, description="How many at most.")]
After = Annotated[
    str, Query(max_length=1000, description="Where the page before ended: its `next`. Empty: from the first.")
]


class Listed(BaseModel, Generic[_Item]):
    """One page of a list."""

    items: list[_Item]
    next: str | None = Field(description="Ask for `after=` this to have what follows; null at the end.", default=None)


def page_of(
    found: Sequence[_Item], limit: int, place: Callable[[_Item], Sequence[str | int | datetime]]
) -> Listed[_Item]:
    """The page of a list of which one more than ``limit`` was looked for; ``place`` says where in it something is."""
    more = len(found) > limit
    return Listed(items=list(found[:limit]), next=_cursor(place(found[limit - 1])) if more else None)


def _cursor(place: Sequence[str | int | datetime]) -> str:
    told = [part.isoformat() if isinstance(part, datetime) else part for part in place]
    return base64.urlsafe_b64encode(json.dumps(told).encode()).decode().rstrip("=")


def place_after(after: str, *kinds: type) -> tuple[Any, ...] | None:
    """The place that a ``next`` of ours holds; None for the beginning. Raises HTTPException 422 for another text."""
    if not after:
        return None
    try:
        place = read_json(base64.b64decode(after + "=" * (-len(after) % 4), altchars=b"-_", validate=True))
        return tuple(_part(part, kind) for part, kind in zip(place, kinds, strict=True))
    except (ValueError, TypeError, OverflowError):
        raise HTTPException(422, "after: expected the `next` of the page before.") from None


def _part(part: object, kind: type) -> object:
    if kind is datetime and isinstance(part, str):
        return datetime.fromisoformat(part).astimezone(UTC)
    if type(part) is not kind or (isinstance(part, int) and not 0 <= part < 2**31):
        raise TypeError(kind)
    return part


def tagged(request: Request, body: bytes, media_type: str, **headers: str) -> Response:
    """The answer with its tag; without its body for whoever has it already."""
    tag = f'"{hashlib.sha256(body).hexdigest()[:32]}"'
    told = {"etag": tag, "cache-control": "private, no-cache", **headers}
    known = request.headers.get("if-none-match", "")
    if tag in (part.strip().removeprefix("W/") for part in known.split(",")):
        return Response(status_code=304, headers=told)
    return Response(body, media_type=media_type, headers=told)


class ApiRequest(Request):
    """A request whose JSON is bounded, and parsed where it holds up nobody else."""

    async def json(self) -> Any:
        """Return the body's value. Raises HTTPException 422 where reading it would take too much work."""
        if not hasattr(self, "_json"):
            try:
                self._json = await run_in_threadpool(read_json, await self.body(), most_values=_MOST_VALUES)
            except Unreadable as error:
                raise HTTPException(422, f"The JSON of the body cannot be read: {error}.") from None
        return self._json


class RepeatableRoute(APIRoute):
    """A route that answers the same to the same request with the same ``Idempotency-Key``, and does it once."""

    def get_route_handler(self) -> Callable[[Request], Awaitable[Response]]:  # type: ignore[override]
        """As FastAPI asks for it."""
        run = super().get_route_handler()

        async def handler(request: Request) -> Response:
            request = ApiRequest(request.scope, request.receive)
            key = request.headers.get(KEY_HEADER)
            if key is None or request.method != "POST" or NO_KEY.keys() <= (self.openapi_extra or {}).keys():
                return await run(request)
            return await _once(request, key, run)

        return handler


def api_router(tag: str) -> APIRouter:
    """A router for one subject."""
    return APIRouter(tags=[tag], route_class=RepeatableRoute)


async def _once(request: Request, key: str, run: Callable[[Request], Awaitable[Response]]) -> Response:
    if not 0 < len(key) <= LONGEST_KEY or not key.isascii() or not key.isprintable():
        raise HTTPException(422, f"Idempotency-Key: expected from 1 to {LONGEST_KEY} printable characters.")
    context: WebContext = request.app.state.context
    caller = await run_in_threadpool(caller_of, request, context)
    # A reply is that to the caller's role: with another one the request is a new one, and is refused or done as such.
    mine = (context.service, caller.acting, f"{_standing(request, caller.identity)} {key}")
    hashed = _Hashed(request)
    try:
        known = await run_in_threadpool(replies.begin, *mine)
    except InProgress:
        raise HTTPException(
            409, "The first request with this Idempotency-Key is not answered yet.", {"retry-after": "5"}
        ) from None
    if known is not None:
        if await hashed.whole() != known.request_sha256:
            raise HTTPException(422, "Idempotency-Key: another request had this key; expected a new one.")
        media_type = "application/json" if known.body else None
        return Response(known.body, known.status, {"idempotent-replay": "true"}, media_type)
    try:
        answer = await run(ApiRequest(request.scope, hashed.receive))
    except BaseException:
        await run_in_threadpool(replies.forget, *mine)
        raise
    reply = KeptReply(await hashed.whole(), answer.status_code, bytes(answer.body))
    try:
        await run_in_threadpool(replies.keep, *mine, reply)
    except DatabaseError as error:
        # It is done: whoever asked is answered so, and a repetition is refused until the key expires.
        _log.error("web.reply_not_kept", path=request.url.path, error=str(error))
    return answer


def _standing(request: Request, identity: Identity) -> str:
    """The caller's role in the course of the path, and whether they are an operator."""
    course = str(request.path_params.get("course_id", ""))
    role = identity.roles.get(int(course)) if course.isdecimal() and len(course) < 20 else None
    return f"{role or ''}{' operator' if identity.operator else ''}"


class _Hashed:
    """A request whose body is hashed as it is read; what it asks for is part of the hash."""

    def __init__(self, request: Request) -> None:
        self._receive: Receive = request.receive
        self._hash = hashlib.sha256(f"{request.method} {request.url.path}?{request.url.query}\n".encode())
        self._ended = False

    async def receive(self) -> Message:
        """As ASGI has it."""
        message = await self._receive()
        if message["type"] == "http.request":
            self._hash.update(message.get("body", b""))
            self._ended = not message.get("more_body", False)
        else:
            self._ended = True
        return message

    async def whole(self) -> str:
        """The hash of all of it."""
        while not self._ended:
            await self.receive()
        return self._hash.hexdigest()
