"""Near misses: printed, spoken, sent or answered texts that almost match what a criterion expects.

A different number is a different answer, not a near miss. So is a text that matches another expected text.
"""

from __future__ import annotations

import difflib
import re
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass

from responders.message_format import classify_text
from service.grading.hint_clues import Clues
from service.grading.hint_differences import advise_on_difference
from service.grading.judging.message_parts import quote_text
from service.language import translatable
from sim.recording import Verdict
from sim.sentences import Sentence
from submissions.criteria import Criterion
from submissions.criteria.logs import Datalog
from submissions.criteria.replies import Replies
from submissions.criteria.reporting import Events, Reports
from submissions.criteria.sequence import WordSequence
from submissions.criteria.texts import Messages, Prints, Says, TextSequence
from submissions.submission import PART_FILES, Part

_MIN_SIMILARITY = 0.72
_MAX_TEXTS, _MAX_TEXT_LENGTH = 20, 80
_DIGITS = re.compile(r"[\d.,]+")
#: The end of the text that the simulator prints when an image is logged.
_LOGGED = "image data logged..."
_QUOTE = re.compile("[\"']")


@dataclass(frozen=True, slots=True)
class ExpectedText:
    """An expected text, and whether it must be all, the beginning or a part of the actual text."""

    text: str
    how: str

    def split_parts(self, text: str) -> Iterator[str]:
        """Yield the parts of a text to compare: all of it, its first words, or every run of as many words."""
        words, count = text.split(), len(self.text.split())
        if self.how == "equals":
            yield " ".join(words)
            return
        starts = range(1 if self.how == "starts_with" else max(len(words) - count + 1, 1))
        yield from (" ".join(words[place : place + count]) for place in starts)

    def describe(self) -> str:
        """Return the quoted text, and where it is expected."""
        quoted_text = quote_text(self.text)
        if self.how == "equals":
            return quoted_text
        template = translatable("%(text)s in it")
        template = translatable("%(text)s at its start") if self.how == "starts_with" else template
        return Sentence(template, text=quoted_text)

    def is_met_by(self, text: str, *, ignore_case: bool) -> bool:
        """Return whether the text matches, by the criterion's rules."""
        actual, expected = (" ".join(each.split()) for each in (text, self.text))
        if ignore_case:
            actual, expected = actual.casefold(), expected.casefold()
        match self.how:
            case "equals":
                return actual == expected
            case "starts_with":
                return actual.startswith(expected)
            case _:
                return expected in actual


def hint_about_sent_texts(clues: Clues) -> Iterator[str]:
    """Yield hints on messages that are almost right. Later errors follow from them."""
    yield from _hint_about_criteria((each for each in clues.lost if isinstance(each, Messages)), clues)


def hint_about_texts(clues: Clues) -> Iterator[str]:
    """Yield one hint for each criterion that lost marks because a text is almost right."""
    yield from _hint_about_criteria(clues.lost, clues)


def _hint_about_criteria(criteria: Iterable[Criterion], clues: Clues) -> Iterator[str]:
    for criterion in criteria:
        part, texts, template = _find_checked_texts(criterion, clues)
        expected_texts = list(_collect_expected_texts(criterion))
        should_ignore_case = getattr(criterion, "ignore_case", False)
        unexpected_texts = [
            text
            for text in texts
            if not any(each.is_met_by(text, ignore_case=should_ignore_case) for each in expected_texts)
        ]
        for expected_text in expected_texts:
            if any(expected_text.is_met_by(text, ignore_case=should_ignore_case) for text in texts):
                continue
            similar_text = next((text for text in unexpected_texts[:_MAX_TEXTS] if is_near(expected_text, text)), None)
            if similar_text is not None:
                is_whole = expected_text.how == "equals"
                advice = advise_on_difference(expected_text.text, similar_text) if is_whole else ""
                place = describe_quoting_line(clues, part, similar_text)
                problem = Sentence(
                    "%(problem)s; expected %(expected)s",
                    problem=Sentence(template, place=place, text=quote_text(similar_text)),
                    expected=expected_text.describe(),
                    criterion=criterion.id,
                )
                yield Sentence("%(problem)s. %(advice)s", problem=problem, advice=advice) if advice else problem
                break


def hint_about_unspoken_text(clues: Clues) -> Iterator[str]:
    """Yield a hint on a text that is printed instead of said, if nothing is said."""
    texts_by_criterion = [
        list(_collect_expected_texts(each)) for each in clues.lost if isinstance(each, Says) or _is_spoken(each)
    ]
    # After an error, the missing speech may have no other cause.
    if clues.spoken or not texts_by_criterion or any(fault.verdict is Verdict.PROGRAM_ERROR for fault in clues.faults):
        return
    expected_texts = [one for each in texts_by_criterion for one in each]
    printed_texts = [text for text in clues.printed if classify_text(text) == "text" and not text.endswith(_LOGGED)]
    candidates = (
        text for text in printed_texts if not expected_texts or any(is_near(each, text) for each in expected_texts)
    )
    for text in list(candidates)[-1:]:
        location = describe_quoting_line(clues, "program", text)
        yield Sentence(
            "%(place)s prints %(text)s, and nothing is said; expected say(...), which prints as well",
            place=location,
            text=quote_text(text),
        )


def hint_about_missing_series(clues: Clues) -> Iterator[str]:
    """Yield a hint on a datalog series of which nothing is printed."""
    for criterion in clues.lost:
        if not isinstance(criterion, Datalog) or clues.missing is not None:
            continue
        label = ExpectedText(f"{criterion.series}:", "starts_with")
        has_label = any(is_near(label, text) or label.is_met_by(text, ignore_case=True) for text in clues.printed)
        if has_label or any(True for _ in clues.faults):
            continue
        place = next((each.locate(None) for each in clues.programs), Sentence("the notebook"))
        yield Sentence(
            '%(place)s never prints a line such as "%(series)s: 42". Add print("%(series)s: " + str(...)) where '
            "the value is read. If it is the program of another assignment, submit the right one",
            place=place,
            series=criterion.series,
        )
        return


def _is_spoken(criterion: Criterion) -> bool:
    return isinstance(criterion, WordSequence | Reports | Events) and criterion.source == "speech"


def _find_checked_texts(criterion: Criterion, clues: Clues) -> tuple[Part, Sequence[str], str]:
    """Return the part and the texts that a criterion checks, and a sentence on them; no texts for other criteria."""
    prints = translatable("%(place)s prints %(text)s")
    match criterion:
        case Datalog():
            return "program", clues.printed, prints
        case Says():
            return "program", clues.spoken, translatable("%(place)s says %(text)s")
        case Prints():
            return "program", clues.printed, prints
        case Messages(json_queue=False, agents=()):
            return "program", clues.sent, translatable("%(place)s sends %(text)s")
        case Replies(path=None, agents=()):
            return "responder", clues.answers, translatable("%(place)s answers %(text)s")
    return "program", (), ""


def _collect_expected_texts(criterion: Criterion) -> Iterator[ExpectedText]:
    if isinstance(criterion, Datalog):
        yield ExpectedText(f"{criterion.series}:", "starts_with")
    if isinstance(criterion, TextSequence | Replies):
        for comparison in ("equals", "starts_with", "contains"):
            yield from (ExpectedText(text, comparison) for text in getattr(criterion, comparison))
    if isinstance(criterion, TextSequence) and criterion.compare != "matches":
        yield from (ExpectedText(text, criterion.compare) for text in criterion.in_order)
    if isinstance(criterion, Replies):
        yield from (ExpectedText(text, "equals") for text in criterion.expect.values() if isinstance(text, str))


def is_near(expected: ExpectedText, text: str) -> bool:
    """Return whether a part of the text is close to the expected text."""
    if len(expected.text) > _MAX_TEXT_LENGTH or len(text) > _MAX_TEXT_LENGTH:
        return False
    return any(_is_similar(part, expected.text) for part in expected.split_parts(text))


def _is_similar(actual: str, reference: str) -> bool:
    """Return whether the texts differ by a few characters, and not only by numbers."""
    actual_pattern, expected_pattern = (_DIGITS.sub("0", each) for each in (actual, reference))
    if actual_pattern == expected_pattern or not any(letter.isalpha() for letter in expected_pattern):
        return False
    return (
        difflib.SequenceMatcher(None, actual_pattern.casefold(), expected_pattern.casefold()).ratio() >= _MIN_SIMILARITY
    )


def describe_quoting_line(clues: Clues, part: Part, text: str) -> str:
    """Return the line that quotes the longest beginning of the text."""
    words = text.split()
    for count in range(min(len(words), 12), 0, -1):
        opening = " ".join(words[:count])
        for listing in clues.list_texts(part):
            for number, line in enumerate(listing.lines, 1):
                if len(opening) > 2 and opening in line and _QUOTE.search(line):
                    return listing.locate(number)
    return PART_FILES[part] if any(each.part == part for each in clues.listings) else Sentence("the notebook")
