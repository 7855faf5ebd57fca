"""Requests to a platform for JSON, to addresses whose origin an operator registered, in whatever network they are.

How an address is asked, and how long, is ``service.outside``'s.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from service.outside import ALL_OTHERS, NotReached, ask
from service.version import GRADER_VERSION
from sim.errors import HostError
from sim.readers.json_text import read_json

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
    host = url.partition("//")[2].partition("/")[0]
    told = {"User-Agent": f"Robomark/{GRADER_VERSION}", **(headers or {})}
    try:
        answer = ask(url, method=method, body=body, headers=told, others=ALL_OTHERS, most_bytes=_MOST_BYTES)
    except NotReached as error:
        raise PlatformError(f"The platform at {host} cannot be asked: {error}") from None
    # What is sent has our token in it, which is for nobody else: a redirection is no answer, either.
    if not 200 <= answer.status < 300:
        raise PlatformError(f"The platform at {host} answered {answer.status} to a {method}")
    if len(answer.body) > _MOST_BYTES:
        raise PlatformError(f"The platform at {host} answered more than {_MOST_BYTES} bytes")
    try:
        return Fetched(read_json(answer.body) if answer.body.strip() else None, answer.headers.get("link", ""))
    except ValueError:
        raise PlatformError(f"The platform at {host} answered something that is not JSON") from None
