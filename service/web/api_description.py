"""The OpenAPI 3.1 document of the API, including the error responses that all routes share.

The routes' docstrings describe the routes.
"""

from __future__ import annotations

from typing import Any

from fastapi import FastAPI
from fastapi.openapi.utils import get_openapi

from service.web.api_routes import KEY_HEADER, MAX_KEY_LENGTH
from service.web.request_bodies import MAX_FORM_BYTES, MEGABYTE

_MAX_FORM_MB = MAX_FORM_BYTES // MEGABYTE
_DESCRIPTION = f"""
The API covers all functions of the pages.

**Authentication**: send a token from `/account` or `robomark user token` as `Authorization: Bearer rmt_...`. A token
has the permissions of its owner, limited to its scopes. Objects that the owner cannot see return 404.

**Repeated requests**: a POST with an `Idempotency-Key` runs once. Repetitions within 24 hours return the same response.

**Lists** have pages: `limit` is the maximum number of items. Send `next` of a response as `after` for the next page.

**Errors** are `application/problem+json`, with a message in `detail`.

**Limits**: {_MAX_FORM_MB} MB for a request that is not an upload, and a number of calls per minute for each
token. Further calls return 429 with `Retry-After`.

Timestamps are ISO 8601 with a time zone, and marks are numbers. Durations are in seconds, lengths in millimetres, and
angles in degrees.
"""
_PROBLEM = {
    "type": "object",
    "title": "Problem",
    "description": "An error in the format of RFC 9457.",
    "required": ["type", "title", "status", "detail"],
    "properties": {
        "type": {"type": "string"},
        "title": {"type": "string"},
        "status": {"type": "integer"},
        "detail": {"type": "string", "description": "The error message."},
    },
    "examples": [
        {
            "type": "about:blank",
            "title": "Not Found",
            "status": 404,
            "detail": "There is no such page or item, or you have no access to it.",
        }
    ],
}
_COMMON_ERRORS = {
    "400": "The body does not match its content type.",
    "401": "The token is missing, invalid or expired.",
    "403": "The token does not have the scope.",
    "404": "The item does not exist, or the owner of the token does not have access to it.",
    "422": "The request is invalid, or the action is not possible.",
    "429": "Too many requests; wait for the seconds in `Retry-After`.",
    "503": "The database or the service failed; check whether the change was saved before you try again.",
}
_CHANGE_ERRORS = {
    "409": "The first request with this key is still in progress.",
    "413": "The body is too large.",
    "415": "The body has an unexpected content type.",
}
_KEY_PARAMETER = {
    "name": KEY_HEADER.title(),
    "in": "header",
    "required": False,
    "description": "Any unique text. Requests with the same key run only once.",
    "schema": {"type": "string", "minLength": 1, "maxLength": MAX_KEY_LENGTH, "pattern": "^[ -~]+$"},
}


def build_openapi(app: FastAPI) -> dict[str, Any]:
    """Return the OpenAPI document. It is generated once."""
    if app.openapi_schema is None:
        document = get_openapi(
            title="Robomark", version=app.version, description=_DESCRIPTION.strip(), routes=app.routes
        )
        schemas = document.setdefault("components", {}).setdefault("schemas", {})
        schemas["Problem"] = _PROBLEM
        for schema_name in ("HTTPValidationError", "ValidationError"):
            schemas.pop(schema_name, None)
        for operations in document["paths"].values():
            for method, operation in operations.items():
                _add_error_responses(method, operation)
        for schema in schemas.values():
            # FastAPI omits null values, in examples too.
            for example in schema.get("examples", ()):
                example.update({name: None for name in schema.get("required", ()) if name not in example})
        app.openapi_schema = document
    return app.openapi_schema


def _add_error_responses(method: str, operation: dict[str, Any]) -> None:
    sentences = _COMMON_ERRORS | (_CHANGE_ERRORS if method != "get" else {})
    content = {"application/problem+json": {"schema": {"$ref": "#/components/schemas/Problem"}}}
    for status, sentence in sentences.items():
        operation["responses"][status] = {"description": sentence, "content": content}
    if method == "post" and not operation.pop("x-no-key", False):
        operation.setdefault("parameters", []).append(_KEY_PARAMETER)
