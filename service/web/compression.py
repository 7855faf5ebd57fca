"""Compression of static files and of the API's grades, reports and replays, for clients that accept gzip.

Pages are not compressed: they contain the secrets of forms beside text that others can choose, and the length of a
compressed page would disclose the secrets (BREACH). The API reads no cookies, so no other site can call it.
"""

from __future__ import annotations

import gzip
from typing import TypeVar

from fastapi import Request
from fastapi.responses import Response

_MIN_SIZE = 1024  # bytes; a smaller body fits into one packet anyway
_LEVEL = 4
AnyResponse = TypeVar("AnyResponse", bound=Response)


def compress_response(request: Request, response: AnyResponse) -> AnyResponse:
    """Return the response, with its body compressed if the client accepts gzip and the body is not tiny."""
    if len(response.body) < _MIN_SIZE:
        return response
    response.headers.add_vary_header("accept-encoding")
    if _is_gzip_accepted(request.headers.get("accept-encoding", "")):
        response.body = gzip.compress(response.body, _LEVEL, mtime=0)
        response.headers["content-encoding"] = "gzip"
        response.headers["content-length"] = str(len(response.body))
    return response


def _is_gzip_accepted(header: str) -> bool:
    """Return whether an ``Accept-Encoding`` header names gzip, or everything, without a weight of zero."""
    weights = {}
    for part in header.lower().split(","):
        name, _, weight = part.partition(";")
        weights[name.strip()] = weight.replace(" ", "")
    weight = weights.get("gzip", weights.get("*", "q=0"))
    return weight.rstrip("0.") != "q="
