"""Error responses of the API, in the format of RFC 9457. ``errors.py`` contains those for people."""

from __future__ import annotations

from http import HTTPStatus

from starlette.responses import JSONResponse

API_PREFIX = "/api/"


def respond_with_problem(status: int, sentence: str, headers: dict[str, str] | None = None) -> JSONResponse:
    """Return a problem+json response with one sentence."""
    body = {"type": "about:blank", "title": HTTPStatus(status).phrase, "status": status, "detail": sentence}
    return JSONResponse(body, status, headers, "application/problem+json")
