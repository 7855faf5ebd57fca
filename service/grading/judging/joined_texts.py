"""Lists in sentences: parts joined by commas, semicolons or "or", so that they can still be translated.

``sim/sentences.py`` joins with "and".
"""

from __future__ import annotations

from collections.abc import Sequence

from service.language import translatable
from sim.sentences import Sentence


def join_with_or(parts: Sequence[str]) -> str:
    """Join the parts with "or"; empty for no parts."""
    return _join(translatable("%(these)s or %(last)s"), parts)


def join_with_commas(parts: Sequence[str]) -> str:
    """Join the parts with commas; empty for no parts."""
    return _join(translatable("%(these)s, %(last)s"), parts)


def join_with_semicolons(parts: Sequence[str]) -> str:
    """Join the parts with semicolons; empty for no parts."""
    return _join(translatable("%(these)s; %(last)s"), parts)


def _join(template: str, parts: Sequence[str]) -> str:
    if len(parts) < 2:
        return parts[0] if parts else ""
    # Halves, because sentences must not be nested as deeply as a list is long.
    middle = len(parts) // 2
    return Sentence(template, these=_join(template, parts[:middle]), last=_join(template, parts[middle:]))
