"""What programs are told when something cannot be: a problem as RFC 9457 has it. For people that is ``errors.py``'s."""

from __future__ import annotations

from http import HTTPStatus

from starlette.responses import JSONResponse

API = "/api/"


def problem(status: int, sentence: str, headers: dict[str, str] | None = None) -> JSONResponse:
    """One sentence for a program, and for the person who reads its log."""
    body = {"type": "about:blank", "title": HTTPStatus(status).phrase, "status": status, "detail": sentence}
    return JSONResponse(body, status, headers, "application/problem+json")
