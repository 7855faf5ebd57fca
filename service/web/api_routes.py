"""Shared features of API routes: idempotency keys, pages of lists, and entity tags.

``api/`` contains the routes, and ``api_description.py`` generates the OpenAPI document.
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
from service.operations.replies import InProgress, StoredReply
from service.operations.sign_in import Identity
from service.web.access import find_course_role
from service.web.api_access import require_caller
from service.web.compression import compress_response
from service.web.context import WebContext
from sim.readers.json_text import read_json
from sim.readers.reader_errors import UnreadableDataError

_log = structlog.get_logger(__name__)
KEY_HEADER = "idempotency-key"
MAX_KEY_LENGTH = 200
#: Maximum number of arrays, objects and their entries in a JSON body.
_MAX_VALUES = 20_000
#: For routes without an idempotency key: they change nothing, or return a secret that must not be stored.
NO_KEY: Mapping[str, Any] = MappingProxyType({"x-no-key": True})
_Item = TypeVar("_Item")
#: Responses of a route for the OpenAPI document, by status.
ResponseDescriptions = dict[int | str, dict[str, Any]]

Limit = Annotated[int, Query(ge=1, le=200, description="Maximum number of items.")]
After = Annotated[
    str, Query(max_length=1000, description="Value of `next` from the previous page. Empty for the first page.")
]


class Listed(BaseModel, Generic[_Item]):
    """One page of a list."""

    items: list[_Item]
    next: str | None = Field(description="Value of `after` for the next page; null on the last page.", default=None)


def build_list_page(
    items: Sequence[_Item], limit: int, get_sort_key: Callable[[_Item], Sequence[str | int | datetime]]
) -> Listed[_Item]:
    """Return a page of a list.

    Args:
        items: The items, with one more than ``limit`` if there is a next page.
        limit: Maximum number of items on the page.
        get_sort_key: Returns the sort key of an item, which the next page starts after.
    """
    has_more = len(items) > limit
    return Listed(items=list(items[:limit]), next=_encode_cursor(get_sort_key(items[limit - 1])) if has_more else None)


def _encode_cursor(sort_key: Sequence[str | int | datetime]) -> str:
    values = [part.isoformat() if isinstance(part, datetime) else part for part in sort_key]
    return base64.urlsafe_b64encode(json.dumps(values).encode()).decode().rstrip("=")


def decode_cursor(cursor: str, *kinds: type) -> tuple[Any, ...] | None:
    """Return the sort key in a cursor, or None for the first page. Raises HTTPException 422 for an invalid cursor."""
    if not cursor:
        return None
    try:
        values = read_json(base64.b64decode(cursor + "=" * (-len(cursor) % 4), altchars=b"-_", validate=True))
        return tuple(_parse_cursor_part(part, kind) for part, kind in zip(values, kinds, strict=True))
    except (ValueError, TypeError, OverflowError):
        raise HTTPException(422, "after: expected the `next` of the previous page.") from None


def _parse_cursor_part(part: object, kind: type) -> object:
    if kind is datetime and isinstance(part, str):
        return datetime.fromisoformat(part).astimezone(UTC)
    if type(part) is not kind or (isinstance(part, int) and not 0 <= part < 2**31):
        raise TypeError(kind)
    if isinstance(part, str):
        # Databases accept neither NUL nor lone surrogates.
        if "\0" in part:
            raise ValueError(part)
        part.encode()
    return part


def respond_with_etag(request: Request, body: bytes, media_type: str, **headers: str) -> Response:
    """Return the response with an entity tag, or 304 without a body if the client already has this version."""
    # A weak one, because it is the same for the compressed body.
    tag = f'W/"{hashlib.sha256(body).hexdigest()[:32]}"'
    all_headers = {"etag": tag, "cache-control": "private, no-cache", **headers}
    known_tags = request.headers.get("if-none-match", "")
    if tag.removeprefix("W/") in (part.strip().removeprefix("W/") for part in known_tags.split(",")):
        return Response(status_code=304, headers=all_headers)
    return compress_response(request, Response(body, media_type=media_type, headers=all_headers))


class ApiRequest(Request):
    """A request whose JSON is limited in size and is parsed in a worker thread."""

    async def json(self) -> Any:
        """Return the parsed body. Raises HTTPException 422 if it is invalid or too complex."""
        if not hasattr(self, "_json"):
            try:
                self._json = await run_in_threadpool(read_json, await self.body(), max_values=_MAX_VALUES)
            except UnreadableDataError as error:
                raise HTTPException(422, f"The JSON of the body cannot be read: {error}.") from None
        return self._json


class RepeatableRoute(APIRoute):
    """A route that runs a request once for each ``Idempotency-Key`` and repeats the response afterwards."""

    def get_route_handler(self) -> Callable[[Request], Awaitable[Response]]:  # type: ignore[override]
        """Return FastAPI's handler, extended by idempotency keys."""
        handle_request = super().get_route_handler()

        async def handler(request: Request) -> Response:
            request = ApiRequest(request.scope, request.receive)
            key = request.headers.get(KEY_HEADER)
            if key is None or request.method != "POST" or NO_KEY.keys() <= (self.openapi_extra or {}).keys():
                return await handle_request(request)
            return await _run_once(request, key, handle_request)

        return handler


def api_router(tag: str) -> APIRouter:
    """Return a router for one subject."""
    return APIRouter(tags=[tag], route_class=RepeatableRoute)


async def _run_once(request: Request, key: str, handle_request: Callable[[Request], Awaitable[Response]]) -> Response:
    if not 0 < len(key) <= MAX_KEY_LENGTH or not key.isascii() or not key.isprintable():
        raise HTTPException(422, f"Idempotency-Key: expected from 1 to {MAX_KEY_LENGTH} printable characters.")
    context: WebContext = request.app.state.context
    caller = await run_in_threadpool(require_caller, request, context)
    # The role is part of the key: after a change of role, the request runs again and is checked again.
    key_owner = (context.service, caller.actor, f"{_format_role_key(request, caller.identity)} {key}")
    hashed_request = _HashedRequest(request)
    try:
        stored_reply = await run_in_threadpool(replies.reserve_key, *key_owner)
    except InProgress:
        raise HTTPException(
            409, "The first request with this Idempotency-Key is still in progress.", {"retry-after": "5"}
        ) from None
    if stored_reply is not None:
        if await hashed_request.finish_hash() != stored_reply.request_sha256:
            raise HTTPException(422, "Idempotency-Key: another request used this key; expected a new key.")
        media_type = "application/json" if stored_reply.body else None
        return Response(stored_reply.body, stored_reply.status, {"idempotent-replay": "true"}, media_type)
    try:
        answer = await handle_request(ApiRequest(request.scope, hashed_request.receive))
    except BaseException:
        await run_in_threadpool(replies.release_key, *key_owner)
        raise
    reply = StoredReply(await hashed_request.finish_hash(), answer.status_code, bytes(answer.body))
    try:
        await run_in_threadpool(replies.store_reply, *key_owner, reply)
    except DatabaseError as error:
        # The request has succeeded, so the client gets its response. Repetitions are rejected until the key expires.
        _log.error("web.reply_not_kept", path=request.url.path, error=str(error))
    return answer


def _format_role_key(request: Request, identity: Identity) -> str:
    """Return the caller's role in the path's course, and ``operator`` for operators, as part of the key."""
    role = find_course_role(identity, str(request.path_params.get("course_id", "")))
    return f"{role or ''}{' operator' if identity.operator else ''}"


class _HashedRequest:
    """A request that computes a hash of method, address and body while the body is read."""

    def __init__(self, request: Request) -> None:
        self._receive: Receive = request.receive
        self._hash = hashlib.sha256(f"{request.method} {request.url.path}?{request.url.query}\n".encode())
        self._ended = False

    async def receive(self) -> Message:
        """Receive a message, as an ASGI callable."""
        message = await self._receive()
        if message["type"] == "http.request":
            self._hash.update(message.get("body", b""))
            self._ended = not message.get("more_body", False)
        else:
            self._ended = True
        return message

    async def finish_hash(self) -> str:
        """Read the rest of the body and return the hash."""
        while not self._ended:
            await self.receive()
        return self._hash.hexdigest()
