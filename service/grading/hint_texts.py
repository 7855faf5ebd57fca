"""Texts that are nearly what a criterion asks for: what was printed, said, sent or answered, beside what was expected.

Another number is another answer, and no near miss; nor is a text that stands for another of those that are asked for.
"""

from __future__ import annotations

import difflib
import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from responders.message_format import kind
from service.grading.hint_clues import Clues
from service.grading.judging.words import quoted
from submissions.criteria import Criterion
from submissions.criteria.replies import Replies
from submissions.criteria.texts import Messages, Prints, Says, TextSequence
from submissions.submission import PART_FILES, Part

_NEAR = 0.72
_MOST_TEXTS, _LONGEST = 20, 80
_DIGITS = re.compile(r"[\d.,]+")
_QUOTE = re.compile("[\"']")


@dataclass(frozen=True, slots=True)
class _Wanted:
    """A text that is asked for, and whether it is all, the beginning or some of what counts."""

    text: str
    how: str

    def compared_parts(self, text: str) -> Iterator[str]:
        """What of a text is to be compared with it: all, as many words from its start, or from anywhere."""
        words, count = text.split(), len(self.text.split())
        if self.how == "equals":
            yield " ".join(words)
            return
        places = range(1 if self.how == "starts_with" else max(len(words) - count + 1, 1))
        yield from (" ".join(words[place : place + count]) for place in places)

    def is_met_by(self, text: str, *, ignore_case: bool) -> bool:
        """As the criterion compares them."""
        given, plain = (" ".join(each.split()) for each in (text, self.text))
        if ignore_case:
            given, plain = given.casefold(), plain.casefold()
        match self.how:
            case "equals":
                return given == plain
            case "starts_with":
                return given.startswith(plain)
            case _:
                return plain in given


def of_texts(clues: Clues) -> Iterator[str]:
    """One for each criterion that has lost marks by a text that is nearly right."""
    for criterion in clues.lost:
        part, texts, verb = _looked_at(criterion, clues)
        wanted = list(_wanted(criterion))
        folds = getattr(criterion, "ignore_case", False)
        strange = [text for text in texts if not any(each.is_met_by(text, ignore_case=folds) for each in wanted)]
        for each in wanted:
            if any(each.is_met_by(text, ignore_case=folds) for text in texts):
                continue
            near = next((text for text in strange[:_MOST_TEXTS] if _is_near(each, text)), None)
            if near is not None:
                at = {"equals": "", "starts_with": " at its start"}.get(each.how, " in it")
                yield f"{_where(clues, part, near)} {verb} {quoted(near)}; expected {quoted(each.text)}{at}"
                break


def of_unspoken(clues: Clues) -> Iterator[str]:
    """A text that is printed where it should be said, and nothing is."""
    wanted = [list(_wanted(each)) for each in clues.lost if isinstance(each, Says)]
    if clues.spoken or not wanted:
        return
    asked = [one for each in wanted for one in each]
    printed = [text for text in clues.printed if kind(text) == "text"]
    meant = (text for text in printed if not asked or any(_is_near(each, text) for each in asked))
    for text in list(meant)[-1:]:
        where = _where(clues, "program", text)
        yield f"{where} prints {quoted(text)}, and nothing is said; expected say(...), which prints as well"


def _looked_at(criterion: Criterion, clues: Clues) -> tuple[Part, Sequence[str], str]:
    """Whose texts a criterion looks at, and how they came about; none where it looks at anything else."""
    match criterion:
        case Says():
            return "program", clues.spoken, "says"
        case Prints():
            return "program", clues.printed, "prints"
        case Messages(json_queue=False, agents=()):
            return "program", clues.sent, "sends"
        case Replies(path=None, agents=()):
            return "responder", clues.answers, "answers"
    return "program", (), ""


def _wanted(criterion: Criterion) -> Iterator[_Wanted]:
    if isinstance(criterion, TextSequence | Replies):
        for how in ("equals", "starts_with", "contains"):
            yield from (_Wanted(text, how) for text in getattr(criterion, how))
    if isinstance(criterion, TextSequence) and criterion.compare != "matches":
        yield from (_Wanted(text, criterion.compare) for text in criterion.in_order)
    if isinstance(criterion, Replies):
        yield from (_Wanted(text, "equals") for text in criterion.expect.values() if isinstance(text, str))


def _is_near(wanted: _Wanted, text: str) -> bool:
    if len(wanted.text) > _LONGEST or len(text) > _LONGEST:
        return False
    return any(_alike(part, wanted.text) for part in wanted.compared_parts(text))


def _alike(one: str, other: str) -> bool:
    """Whether they differ by a few letters, blanks or signs, and not by numbers alone."""
    plain, expected = (_DIGITS.sub("0", each) for each in (one, other))
    if plain == expected or not any(letter.isalpha() for letter in expected):
        return False
    return difflib.SequenceMatcher(None, plain.casefold(), expected.casefold()).ratio() >= _NEAR


def _where(clues: Clues, part: Part, text: str) -> str:
    """The line that has most of the text's beginning in quotes."""
    words = text.split()
    for count in range(min(len(words), 12), 0, -1):
        begin = " ".join(words[:count])
        for listing in clues.of(part):
            for number, line in enumerate(listing.lines, 1):
                if len(begin) > 2 and begin in line and _QUOTE.search(line):
                    return listing.at(number)
    return PART_FILES[part] if any(each.part == part for each in clues.listings) else "the notebook"
