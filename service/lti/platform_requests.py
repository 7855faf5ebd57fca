"""JSON requests to platforms, at origins that an operator registered, in any network.

``service.outgoing_requests`` contains connection handling and time-outs.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from service.outgoing_requests import ALL_NETWORKS, RequestFailure, send_request
from service.version import GRADER_VERSION
from sim.errors import HostError
from sim.readers.json_text import read_json

_MAX_BYTES = 4 * 2**20


class PlatformError(HostError):
    """A learning platform did not fulfil a request."""


@dataclass(frozen=True, slots=True)
class PlatformReply:
    """The reply of a platform."""

    value: Any  # JSON; None for an empty reply
    link: str  # the header that names further pages


def fetch_json(
    url: str, *, method: str = "GET", body: bytes | None = None, headers: Mapping[str, str] | None = None
) -> PlatformReply:
    """Send one request and return the reply. Raises PlatformError, with the host, for a failure or invalid JSON."""
    host = url.partition("//")[2].partition("/")[0]
    request_headers = {"User-Agent": f"Robomark/{GRADER_VERSION}", **(headers or {})}
    try:
        answer = send_request(
            url, method=method, body=body, headers=request_headers, allowlist=ALL_NETWORKS, max_bytes=_MAX_BYTES
        )
    except RequestFailure as error:
        raise PlatformError(f"The platform at {host} cannot be reached: {error}") from None
    # Requests contain our token, which no other host may get, so a redirection is an error, too.
    if not 200 <= answer.status < 300:
        raise PlatformError(f"The platform at {host} returned status {answer.status} for a {method} request")
    if len(answer.body) > _MAX_BYTES:
        raise PlatformError(f"The platform at {host} returned more than {_MAX_BYTES} bytes")
    try:
        return PlatformReply(read_json(answer.body) if answer.body.strip() else None, answer.headers.get("link", ""))
    except ValueError:
        raise PlatformError(f"The platform at {host} returned a response that is not JSON") from None
