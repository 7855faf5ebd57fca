"""Tokens of texts for comparison: words, numbers, labels, and the times when utterances end."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise

from sim.recording import TimedText

_SMALL = [
    "zero",
    "one",
    "two",
    "three",
    "four",
    "five",
    "six",
    "seven",
    "eight",
    "nine",
    "ten",
    "eleven",
    "twelve",
    "thirteen",
    "fourteen",
    "fifteen",
    "sixteen",
    "seventeen",
    "eighteen",
    "nineteen",
    "twenty",
]
_TENS = ["thirty", "forty", "fifty", "sixty", "seventy", "eighty", "ninety", "hundred"]
_NUMBERS = {word: str(number) for number, word in enumerate(_SMALL)} | {
    word: str(number) for number, word in zip(range(30, 101, 10), _TENS, strict=True)
}
#: The longest student text that is tokenized.
_MAX_CHARACTERS = 20_000
_MAX_ANSWER_CHARACTERS = 10_000
_WORD = re.compile(r"[^\W_]+")
#: A number as Python writes it, or a word. Runs of digits are possessive, which avoids backtracking.
_TOKEN = re.compile(r"(?P<number>(?<![\w.])[-+]?(?:\d++(?:\.\d*+)?|\.\d++)(?:[eE][-+]?\d{1,3})?(?![^\W_]))|[^\W_]++")


def split_words(text: str) -> list[str]:
    """Return the words in order, without case and punctuation; "ten" is "10", "one hundred" is "100"."""
    words = [_NUMBERS.get(word, word) for word in _WORD.findall(text[:_MAX_CHARACTERS].casefold())]
    merged_words = [word for word, after in pairwise([*words, ""]) if not (word in ("1", "a") and after == "100")]
    return merged_words


@dataclass(frozen=True, slots=True)
class Token:
    """A word, and its value if it is a number."""

    word: str
    value: float | None


def tokenize_text(text: str) -> list[Token]:
    """Return the words and numbers in order, with numbers in Python's notation."""
    tokens = []
    for match in _TOKEN.finditer(text[:_MAX_CHARACTERS].casefold()):
        word = _NUMBERS.get(match[0], match[0])
        tokens.append(Token(word, float(word) if match["number"] or word.isdecimal() else None))
    return tokens


def find_words(words: Sequence[str], phrase: Sequence[str]) -> int | None:
    """Return the first place that matches all of ``phrase``, or None."""
    phrase = list(phrase)
    for index in range(len(words) - len(phrase) + 1):
        if list(words[index : index + len(phrase)]) == phrase:
            return index
    return None


def compute_speech_ends(lines: Sequence[TimedText]) -> list[float]:
    """Return the end time of each utterance, in seconds: they queue up, at 130 words a minute."""
    ends: list[float] = []
    for line in lines:
        start = max(line.t, ends[-1] if ends else 0.0)
        ends.append(start + len(line.text.split()) * 60 / 130)
    return ends


class LabelFinder:
    """Finds labels and their aliases in a text, the longest first, as whole words."""

    def __init__(self, labels: Iterable[str], aliases: Mapping[str, Sequence[str]]) -> None:
        self._names: dict[str, str] = {}
        for label in labels:
            self._names[_normalise_spelling(label)] = label
        for label, alias_names in aliases.items():
            for name in (label, *alias_names):
                self._names.setdefault(_normalise_spelling(name), self.to_canonical(label))
        longest_first = sorted((name for name in self._names if name), key=len, reverse=True)
        alternatives = "|".join(map(re.escape, longest_first))
        self._pattern = re.compile(rf"(?<!\w)(?:{alternatives})(?!\w)") if alternatives else None

    def to_canonical(self, label: str) -> str:
        """Return the label in the criterion's spelling."""
        return self._names.get(_normalise_spelling(label), label)

    def find_labels(self, text: str) -> list[str]:
        """Return the different labels in a text, in order."""
        if self._pattern is None:
            return []
        matches = self._pattern.findall(_normalise_spelling(text[:_MAX_ANSWER_CHARACTERS]))
        return list(dict.fromkeys(self._names[name] for name in matches))


def _normalise_spelling(text: str) -> str:
    """Return the text without case, hyphens, underscores and extra spaces."""
    return " ".join(re.sub(r"[-‐-―_]", " ", text).casefold().split())
