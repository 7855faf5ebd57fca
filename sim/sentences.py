"""Translatable sentences: English text that remembers the template and values that it was made of.

``service`` translates them; every other reader sees the English text.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from types import MappingProxyType
from typing import Self


class Sentence(str):
    """An English text made of a template with ``%(name)s`` for each value; formats such as ``%(name).2f`` work too.

    Values may be sentences themselves. Without values, the template is literal. Operations on it, such as
    concatenation, return plain text that cannot be translated: use ``join_sentences`` and nested sentences.
    """

    __slots__ = ("template", "values")
    template: str
    values: Mapping[str, object]

    def __new__(cls, template: str, /, **values: object) -> Self:
        """Create the text. Raises KeyError if a value is missing, and TypeError if one does not fit its format."""
        sentence = super().__new__(cls, template % values if values else template)
        sentence.template = template
        sentence.values = MappingProxyType(values)
        return sentence

    def __reduce__(self) -> tuple[object, ...]:
        return _build_sentence, (self.template, dict(self.values))


def _build_sentence(template: str, values: Mapping[str, object]) -> Sentence:
    return Sentence(template, **values)


def join_with_and(parts: Sequence[str]) -> str:
    """Join the parts with "and"; empty for no parts."""
    *head, last = parts or ("",)
    return Sentence("%(these)s and %(last)s", these=join_with_and(head), last=last) if head else last


#: Two sentences beside each other, which every language writes in this way.
_PAIR = "%(first)s %(second)s"


def join_sentences(*sentences: str) -> str:
    """Join sentences with spaces; empty ones are left out."""
    first, *others = [each for each in sentences if each] or [""]
    return Sentence(_PAIR, first=first, second=join_sentences(*others)) if others else first
