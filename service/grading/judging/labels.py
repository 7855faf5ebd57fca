"""Finding labels and their other names in a text.

It compares words only; which label is right, and what that is worth, is decided elsewhere.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping, Sequence

_LONGEST_ANSWER = 10_000


class LabelFinder:
    """Finds labels and their other names in a text, the longest first, as whole words."""

    def __init__(self, labels: Iterable[str], aliases: Mapping[str, Sequence[str]]) -> None:
        self._names: dict[str, str] = {}
        for label in labels:
            self._names[_words(label)] = label
        for label, others in aliases.items():
            for name in (label, *others):
                self._names.setdefault(_words(name), self.canonical(label))
        longest_first = sorted((name for name in self._names if name), key=len, reverse=True)
        alternatives = "|".join(map(re.escape, longest_first))
        self._pattern = re.compile(rf"(?<!\w)(?:{alternatives})(?!\w)") if alternatives else None

    def canonical(self, label: str) -> str:
        """The label as the criterion spells it."""
        return self._names.get(_words(label), label)

    def labels_in(self, text: str) -> list[str]:
        """The different labels that a text names, in the order in which it names them."""
        if self._pattern is None:
            return []
        found = self._pattern.findall(_words(text[:_LONGEST_ANSWER]))
        return list(dict.fromkeys(self._names[name] for name in found))


def _words(text: str) -> str:
    """Without case, hyphens, underscores and extra spaces."""
    return " ".join(re.sub(r"[-‐-―_]", " ", text).casefold().split())
