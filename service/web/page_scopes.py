"""Scopes of pages, for sessions that were opened with a token. Each page needs the scope of the same API route."""

from __future__ import annotations

import re

#: Pages that every session may open, and signing out.
_FOR_EVERY_SESSION = frozenset({"GET /", "GET /account", "POST /sign-out"})
#: Scopes of routes that change something, by a pattern in the route. The first match counts.
_CHANGES = (
    (re.compile(r"^/account/"), "sign-in"),
    (re.compile(r"/worksheet$"), "read"),
    (re.compile(r"/(grades|appeals)/|/(publish|regrade)$"), "mark"),
    (re.compile(r"^/operator|/(assignments|people|platform|policy)(/|$)"), "manage"),
    (re.compile(""), "submit"),
)


def find_page_scope(method: str, route: str) -> str | None:
    """Return the scope for a method and a route such as ``/courses/{course_id}/batches``, or None if none is needed."""
    if f"{method} {route}" in _FOR_EVERY_SESSION:
        return None
    if method in ("GET", "HEAD"):
        return "read"
    return next(scope for pattern, scope in _CHANGES if pattern.search(route))
