"""Whether a text names somebody. An id or a secret is made of chance letters, among which a short name can be."""

from __future__ import annotations

import re


def is_named(name: str, text: str) -> bool:
    """Return whether ``name`` is in the text as a word of its own."""
    return re.search(rf"(?<![^\W_]){re.escape(name)}(?![^\W_])", text) is not None
