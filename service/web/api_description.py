"""The OpenAPI 3.1 document of the API, including the error responses that all routes share.

The routes' docstrings describe the routes.
"""

from __future__ import annotations

from typing import Any

from fastapi import FastAPI
from fastapi.openapi.utils import get_openapi

from service.web.api_routes import KEY_HEADER, LONGEST_KEY
from service.web.request_bodies import LARGEST_FORM, MEGABYTE

_ABOUT = f"""
Everything that the pages do, for programs.

**Sign in** with a token of `/account` or of `robomark user token`: `Authorization: Bearer rmt_...`. A token does what
its owner may do, and of that what its scopes name. What somebody may not see answers 404, as what there is not.

**Ask again** without harm: a POST with an `Idempotency-Key` is done once, and answered the same for 24 hours.

**Lists** come in pages: `limit` says how long, `after` where to go on, `next` of an answer what to say there.

**Errors** are `application/problem+json`, with a sentence in `detail`.

**Limits**: {LARGEST_FORM // MEGABYTE} MB for a request that is no upload; a number of calls a minute for each token,
then 429 with `Retry-After`.

Moments are ISO 8601 with their zone, marks numbers, times seconds, lengths millimetres, angles degrees.
"""
_PROBLEM = {
    "type": "object",
    "title": "Problem",
    "description": "What is wrong, as RFC 9457 has it.",
    "required": ["type", "title", "status", "detail"],
    "properties": {
        "type": {"type": "string"},
        "title": {"type": "string"},
        "status": {"type": "integer"},
        "detail": {"type": "string", "description": "A sentence for people."},
    },
    "examples": [
        {
            "type": "about:blank",
            "title": "Not Found",
            "status": 404,
            "detail": "There is nothing here, or nothing that you may see.",
        }
    ],
}
_ALWAYS = {
    "400": "The body is not what its type says.",
    "401": "No token, or one that does not count.",
    "403": "The token lacks the scope.",
    "404": "There is nothing here, or nothing that the token's owner may see.",
    "422": "What was sent is not what was expected, or cannot be done.",
    "429": "Too often; `Retry-After` says when to come again.",
    "503": "The database does not answer, or the service failed; check what is stored before you try again.",
}
_OF_CHANGES = {
    "409": "The first request with this key is not answered yet.",
    "413": "The body is longer than is read.",
    "415": "The body has another type than is expected.",
}
_KEY = {
    "name": KEY_HEADER.title(),
    "in": "header",
    "required": False,
    "description": "Any text of your own; the same request with the same key is done once.",
    "schema": {"type": "string", "minLength": 1, "maxLength": LONGEST_KEY, "pattern": "^[ -~]+$"},
}


def described(app: FastAPI) -> dict[str, Any]:
    """Return the OpenAPI document. It is generated once."""
    if app.openapi_schema is None:
        found = get_openapi(title="Robomark", version=app.version, description=_ABOUT.strip(), routes=app.routes)
        schemas = found.setdefault("components", {}).setdefault("schemas", {})
        schemas["Problem"] = _PROBLEM
        for unused in ("HTTPValidationError", "ValidationError"):
            schemas.pop(unused, None)
        for operations in found["paths"].values():
            for method, operation in operations.items():
                _complete(method, operation)
        for schema in schemas.values():
            # FastAPI omits null values, in examples too.
            for example in schema.get("examples", ()):
                example.update({name: None for name in schema.get("required", ()) if name not in example})
        app.openapi_schema = found
    return app.openapi_schema


def _complete(method: str, operation: dict[str, Any]) -> None:
    sentences = _ALWAYS | (_OF_CHANGES if method != "get" else {})
    content = {"application/problem+json": {"schema": {"$ref": "#/components/schemas/Problem"}}}
    for status, sentence in sentences.items():
        operation["responses"][status] = {"description": sentence, "content": content}
    if method == "post" and not operation.pop("x-no-key", False):
        operation.setdefault("parameters", []).append(_KEY)
