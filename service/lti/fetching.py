"""Requests to a platform: bounded in time and bytes, to the addresses that its administrator registered."""

from __future__ import annotations

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


def fetch(
    url: str, *, method: str = "GET", body: bytes | None = None, headers: Mapping[str, str] | None = None
) -> Fetched:
    """The answer to one request. Raises PlatformError, saying whom was asked, where it is no answer or no JSON."""
    host = urlsplit(url).netloc
    if urlsplit(url).scheme not in {"https", "http"}:
        raise PlatformError(f"The platform at {url!r} cannot be asked: expected https://")
    request = urllib.request.Request(url, data=body, method=method, headers=dict(headers or {}))
    try:
        with urllib.request.urlopen(request, timeout=_SECONDS) as answer:
            data = answer.read(_MOST_BYTES + 1)
            link = answer.headers.get("link", "")
    except urllib.error.HTTPError as error:
        raise PlatformError(f"The platform at {host} answered {error.code} to a {method}") from None
    except OSError as error:
        raise PlatformError(f"The platform at {host} does not answer: {error}") from None
    if len(data) > _MOST_BYTES:
        raise PlatformError(f"The platform at {host} answered more than {_MOST_BYTES} bytes")
    try:
        return Fetched(json.loads(data) if data.strip() else None, link)
    except ValueError:
        raise PlatformError(f"The platform at {host} answered something that is not JSON") from None
