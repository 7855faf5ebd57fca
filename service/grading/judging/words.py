"""Texts taken apart for comparing, and sentences put together for students: quotes, places, why a run ended early.

What went wrong is said by the modules of the families.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise

from service.grading.grade import TrialResult
from service.grading.judging.outcome import Outcome, cut
from sim.recording import Fault, Line, Verdict
from submissions.sweep import CONDITIONS

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
#: Longest text of a student's that is taken apart.
_MOST = 20_000
_MOST_OF_AN_ANSWER = 10_000
_WORD = re.compile(r"[^\W_]+")
#: A number as Python writes it, or a word. Runs of digits are possessive: what was read of them is not read again.
_TOKEN = re.compile(r"(?P<number>(?<![\w.])[-+]?(?:\d++(?:\.\d*+)?|\.\d++)(?:[eE][-+]?\d{1,3})?(?![^\W_]))|[^\W_]++")


def words_of(text: str) -> list[str]:
    """The words in order, without case and punctuation; "ten" is "10", "one hundred" is "100"."""
    words = [_NUMBERS.get(word, word) for word in _WORD.findall(text[:_MOST].casefold())]
    joined = [word for word, after in pairwise([*words, ""]) if not (word in ("1", "a") and after == "100")]
    return joined


@dataclass(frozen=True, slots=True)
class Token:
    """A word, and its value if it is a number."""

    word: str
    value: float | None


def tokens_of(text: str) -> list[Token]:
    """The words and numbers in order, numbers as Python writes them."""
    found = []
    for match in _TOKEN.finditer(text[:_MOST].casefold()):
        word = _NUMBERS.get(match[0], match[0])
        found.append(Token(word, float(word) if match["number"] or word.isdecimal() else None))
    return found


def find_words(words: Sequence[str], wanted: Sequence[str], start: int = 0) -> int | None:
    """The first place from ``start`` on where ``wanted`` stands word for word."""
    wanted = list(wanted)
    for place in range(start, len(words) - len(wanted) + 1):
        if list(words[place : place + len(wanted)]) == wanted:
            return place
    return None


def spoken_until(lines: Sequence[Line]) -> list[float]:
    """When each utterance has been spoken to its end, seconds: they queue up, at 130 words a minute."""
    ends: list[float] = []
    for line in lines:
        begin = max(line.t, ends[-1] if ends else 0.0)
        ends.append(begin + len(line.text.split()) * 60 / 130)
    return ends


_LONGEST_QUOTE = 80


def quoted(text: str) -> str:
    """A text of the student's in a sentence: one line, shortened."""
    line = " ".join(text.split())
    return f'"{line}"' if len(line) <= _LONGEST_QUOTE else f'"{line[: _LONGEST_QUOTE - 3]}..."'


def listed(texts: tuple[str, ...], word: str = "and") -> str:
    """``"a", "b" and "c"``."""
    quotes = [quoted(text) for text in texts]
    return quotes[0] if len(quotes) == 1 else f"{', '.join(quotes[:-1])} {word} {quotes[-1]}"


def fault_words(fault: Fault) -> str:
    """``NameError: name 'x' is not defined (line 3)``."""
    where = f" ({fault.place})" if fault.place else ""
    return f"{fault.message.rstrip('.')}{where}"


def place_words(trial: TrialResult, t: float | None) -> str:
    """``In scenario line, from (100, 800) facing 0°, with light noise 32, at 3.00 s``."""
    start = trial.recording.start
    x, y, heading = (f"{round(value, 1):g}" for value in (start.x, start.y, start.heading))
    words = [f"In scenario {trial.scenario}, from ({x}, {y}) facing {heading}°"]
    if trial.light_noise:
        words.append(f"with light noise {trial.light_noise:g}")
    if trial.motor_noise:
        words.append(f"with motor noise {trial.motor_noise:g}")
    for condition, level in trial.sweep:
        if condition in ("loss", "delay") and level:
            about = CONDITIONS[condition]
            words.append(f"with a {about.words} of {level:g}" + (f" {about.unit}" if condition == "delay" else ""))
    if t is not None:
        words.append(f"at {t:.2f} s")
    return ", ".join(words)


def shown_words(message: str) -> str:
    """What is told of visible trials, for a criterion that has others as well; the same whatever happened in those."""
    return (
        f"{message} Trials that are not shown are marked as well."
        if message
        else "Marked in trials that are not shown."
    )


def early_end(trial: TrialResult, outcome: Outcome | None = None) -> str:
    """Why the run ended before its time, unless the outcome tells already."""
    fault = cut(trial.recording)
    if fault is None or (outcome is not None and fault_words(fault) in outcome.message):
        return ""
    if fault.verdict is Verdict.TIME_LIMIT:
        if outcome is not None and "still running" in outcome.message:
            return ""
        return f" The program was still running when the time was up, at {fault.t:g} s."
    return f" The run ended early, at {fault.t:.2f} s."


class LabelFinder:
    """Finds labels and their other names in a text, the longest first, as whole words."""

    def __init__(self, labels: Iterable[str], aliases: Mapping[str, Sequence[str]]) -> None:
        self._names: dict[str, str] = {}
        for label in labels:
            self._names[_spelled(label)] = label
        for label, others in aliases.items():
            for name in (label, *others):
                self._names.setdefault(_spelled(name), self.canonical(label))
        longest_first = sorted((name for name in self._names if name), key=len, reverse=True)
        alternatives = "|".join(map(re.escape, longest_first))
        self._pattern = re.compile(rf"(?<!\w)(?:{alternatives})(?!\w)") if alternatives else None

    def canonical(self, label: str) -> str:
        """The label as the criterion spells it."""
        return self._names.get(_spelled(label), label)

    def labels_in(self, text: str) -> list[str]:
        """The different labels that a text names, in the order in which it names them."""
        if self._pattern is None:
            return []
        found = self._pattern.findall(_spelled(text[:_MOST_OF_AN_ANSWER]))
        return list(dict.fromkeys(self._names[name] for name in found))


def _spelled(text: str) -> str:
    """Without case, hyphens, underscores and extra spaces."""
    return " ".join(re.sub(r"[-‐-―_]", " ", text).casefold().split())
