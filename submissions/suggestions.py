"""Suggestions for misspelt names, and lists of names in words."""

from __future__ import annotations

import difflib
from collections.abc import Iterable

_MAX_NAME_LENGTH = 100


def suggest_name(name: str, known_names: Iterable[str]) -> str:
    """Return ``; did you mean "x"?`` for a similar name, otherwise an empty text."""
    # The time is proportional to the product of the lengths.
    if len(name) > _MAX_NAME_LENGTH:
        return ""
    by_lower = {k.lower(): k for k in known_names}
    matches = difflib.get_close_matches(name.lower(), by_lower, n=1, cutoff=0.6)
    return f'; did you mean "{by_lower[matches[0]]}"?' if matches else ""


def join_with_or(names: Iterable[str]) -> str:
    """Return the names as ``"a", "b" or "c"``."""
    quoted = [f'"{name}"' for name in names]
    return quoted[0] if len(quoted) == 1 else f"{', '.join(quoted[:-1])} or {quoted[-1]}"
