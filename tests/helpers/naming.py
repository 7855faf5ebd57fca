"""Search a text for a name. Random ids and secrets can contain a short name by chance."""

from __future__ import annotations

import re


def is_named(name: str, text: str) -> bool:
    """Return whether ``name`` is in the text as a separate word."""
    return re.search(rf"(?<![^\W_]){re.escape(name)}(?![^\W_])", text) is not None
