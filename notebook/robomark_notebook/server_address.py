"""The address of a server, or of a course on it, as people type it."""

from __future__ import annotations

import re
from dataclasses import dataclass
from urllib.parse import urlsplit

from robomark_notebook.engine import EngineError

_LOCAL_HOSTS = frozenset({"localhost", "127.0.0.1", "::1"})
_COURSE = re.compile(r"/courses/([0-9]{1,9})(?:/.*)?$")


@dataclass(frozen=True, slots=True)
class ServerAddress:
    """The address of a server without a final slash, and the id of the course in it, if any."""

    server: str
    course_id: int | None

    def __str__(self) -> str:
        return self.server if self.course_id is None else f"{self.server}/courses/{self.course_id}"


def parse_address(url: str) -> ServerAddress:
    """Return an address; without a scheme, it is one of https.

    Raises:
        EngineError: It is not an address, or others on the network could read the token on the way to it.
    """
    text = url.strip() if "://" in url else f"https://{url.strip()}"
    try:
        parts = urlsplit(text)
        host, _port = parts.hostname, parts.port
    except ValueError:
        host = None
    if not host or parts.scheme not in ("https", "http") or parts.username is not None:
        raise EngineError(
            f"{url[:200]} is not the address of a server. Expected one such as https://robomark.example.org."
        )
    if parts.scheme == "http" and host not in _LOCAL_HOSTS:
        raise EngineError(f"Connect with https://{host}: over http, others on the network could read your token.")
    course = _COURSE.search(parts.path)
    path = parts.path[: course.start()] if course else parts.path
    return ServerAddress(f"{parts.scheme}://{parts.netloc}{path}".rstrip("/"), int(course[1]) if course else None)
