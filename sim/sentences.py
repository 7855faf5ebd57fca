"""Translatable sentences: a template and its values.

Converted to text here, a sentence is English. ``service`` translates it.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field


@dataclass(frozen=True, slots=True)
class Sentence:
    """A template with ``%(name)s`` for each value. Values may be sentences too. Without values, the text is literal."""

    template: str
    values: Mapping[str, object] = field(default_factory=dict)

    def __str__(self) -> str:
        return self.template % self.values if self.values else self.template


def join_with_and(parts: Sequence[str | Sentence]) -> str | Sentence:
    """Join the parts with "and"; empty for no parts."""
    *head, last = parts or ("",)
    return Sentence("%(these)s and %(last)s", {"these": join_with_and(head), "last": last}) if head else last
