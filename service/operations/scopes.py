"""Scopes of tokens and of the sessions started with them. Each route declares the scope that it needs."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from types import MappingProxyType

from service.language import translatable
from service.store.states import Role

#: By name; a token has its owner's permissions, limited to its scopes.
SCOPES: Mapping[str, str] = MappingProxyType(
    {
        "read": translatable("read everything that its owner can see"),
        "submit": translatable("submit as a student, or submit batches as an instructor"),
        "mark": translatable("adjust marks, comment, publish and regrade"),
        "manage": translatable("open assignments, change policies, enrol and delete"),
        "sign-in": translatable("sign in a browser with the same scopes; end sessions and tokens"),
    }
)
_STAFF_SCOPES = frozenset({"mark", "manage"})


def list_offered_scopes(
    roles: Collection[Role], *, operator: bool, limit: frozenset[str] | None = None
) -> dict[str, str]:
    """Return the scopes that a token of a person with these roles can use, within those of the current session."""
    is_staff = operator or Role.INSTRUCTOR in roles
    return {
        scope: words
        for scope, words in SCOPES.items()
        if (is_staff or scope not in _STAFF_SCOPES) and (limit is None or scope in limit)
    }
