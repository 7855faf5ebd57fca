"""The scope that each page needs of a session that a token opened, the same as its route of the API."""

from __future__ import annotations

import re

#: Pages that every session may open, and the way out.
_FOR_EVERY_SESSION = frozenset({"GET /", "GET /account", "POST /sign-out"})
#: By a pattern in the route of what changes something; the first that fits.
_CHANGES = (
    (re.compile(r"^/account/"), "sign-in"),
    (re.compile(r"/worksheet$"), "read"),
    (re.compile(r"/(grades|appeals)/|/(publish|regrade)$"), "mark"),
    (re.compile(r"^/operator|/(assignments|people|platform|policy)(/|$)"), "manage"),
    (re.compile(""), "submit"),
)


def scope_of_page(method: str, route: str) -> str | None:
    """The scope for a method and a route such as ``/courses/{course_id}/batches``; None if any session may."""
    if f"{method} {route}" in _FOR_EVERY_SESSION:
        return None
    if method in ("GET", "HEAD"):
        return "read"
    return next(scope for pattern, scope in _CHANGES if pattern.search(route))
