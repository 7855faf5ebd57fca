"""Requests to a platform: bounded in time and bytes, to the addresses that its administrator registered."""

from __future__ import annotations

import http.client
import json
import urllib.error
import urllib.request
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any
from urllib.parse import urlsplit

from sim.errors import HostError

_SECONDS = 10
_MOST_BYTES = 4 * 2**20


class PlatformError(HostError):
    """A learning platform does not do what it is asked."""


@dataclass(frozen=True, slots=True)
class Fetched:
    """What a platform answered."""

    value: Any  # JSON; None where it answered nothing
    link: str  # the header that names further pages


class _NoRedirection(urllib.request.HTTPRedirectHandler):
    """What is sent has our token in it, which is for nobody else."""

    def redirect_request(self, *_: Any) -> None:
        return None


_OPENER = urllib.request.build_opener(_NoRedirection)


def fetch(
    url: str, *, method: str = "GET", body: bytes | None = None, headers: Mapping[str, str] | None = None
) -> Fetched:
    """The answer to one request. Raises PlatformError, saying whom was asked, where it is no answer or no JSON."""
    host = urlsplit(url).netloc
    if urlsplit(url).scheme not in {"https", "http"}:
        raise PlatformError(f"The platform at {url!r} cannot be asked: expected https://")
    try:
        request = urllib.request.Request(url, data=body, method=method, headers=dict(headers or {}))
        with _OPENER.open(request, timeout=_SECONDS) as answer:
            data = answer.read(_MOST_BYTES + 1)
            link = answer.headers.get("link", "")
    except urllib.error.HTTPError as error:
        raise PlatformError(f"The platform at {host} answered {error.code} to a {method}") from None
    except (OSError, http.client.HTTPException, ValueError) as error:
        raise PlatformError(f"The platform at {host} does not answer: {error}") from None
    if len(data) > _MOST_BYTES:
        raise PlatformError(f"The platform at {host} answered more than {_MOST_BYTES} bytes")
    try:
        return Fetched(json.loads(data) if data.strip() else None, link)
    except ValueError:
        raise PlatformError(f"The platform at {host} answered something that is not JSON") from None
