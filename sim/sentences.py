"""Translatable sentences: English text that remembers the template and values that it was made of.

``service`` translates them; every other reader sees the English text.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from types import MappingProxyType
from typing import Literal, Self


class Sentence(str):
    """An English text made of a template with ``%(name)s`` for each value; formats such as ``%(name).2f`` work too.

    Values may be sentences themselves. A value that the template does not name is for code that reads the sentence.
    Without values, the template is literal. Operations on it, such as concatenation, return plain text that cannot be
    translated: use ``join_sentences`` and nested sentences.
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


def iterate_parts(sentence: str) -> Iterator[Sentence]:
    """Yield a sentence and the sentences that are its values, from the outside in; nothing for plain text."""
    if isinstance(sentence, Sentence):
        yield sentence
        for value in sentence.values.values():
            yield from iterate_parts(value) if isinstance(value, Sentence) else ()


def iterate_values(sentence: str) -> Iterator[tuple[str, object]]:
    """Yield the names and values of a sentence and of the sentences that are its values, from the outside in."""
    return (item for part in iterate_parts(sentence) for item in part.values.items())


def find_opening(sentence: str, template: str) -> Sentence | None:
    """Return the sentence with this template if ``sentence`` is one or begins with one; otherwise None."""
    while isinstance(sentence, Sentence) and sentence.template != template:
        opening = sentence.values.get(_find_edge_part(sentence.template, 0))
        sentence = opening if isinstance(opening, Sentence) else ""
    return sentence if isinstance(sentence, Sentence) else None


_PART = re.compile(r"%\((\w+)\)s")


def make_clause(sentence: str) -> str:
    """Return a sentence as a part of another one: with a small first letter, and without its final full stop.

    Where the catalogue has only the whole sentence, ``service.language`` translates that, without its full stop.
    """
    return drop_full_stop(_change_edge(sentence, 0, lambda text: text[:1].lower() + text[1:]))


def drop_full_stop(sentence: str) -> str:
    """Return a sentence without its final full stop."""
    return _change_edge(sentence, -1, lambda text: text.rstrip("."))


def _change_edge(sentence: str, edge: Literal[0, -1], change: Callable[[str], str]) -> str:
    """Return the sentence with the change made to its template, or to the value that begins (0) or ends (-1) it."""
    if not isinstance(sentence, Sentence):
        return change(sentence)
    name = _find_edge_part(sentence.template, edge) if sentence.values else ""
    if not name:
        return Sentence(change(sentence.template), **sentence.values)
    value = sentence.values[name]
    if not isinstance(value, str):
        return sentence
    return Sentence(sentence.template, **{**sentence.values, name: _change_edge(value, edge, change)})


def _find_edge_part(template: str, edge: Literal[0, -1]) -> str:
    """Return the name of the value that begins or ends the template; empty if a word does."""
    if edge == 0:
        match = _PART.match(template)
    else:
        match = _PART.fullmatch(template, template.rfind("%(")) if "%(" in template else None
    return match[1] if match is not None else ""
