"""Conditions on one text: whether a text meets them, and the wording for printed, said, sent and received texts.

The texts come from students, the patterns from instructors. Matching takes time linear in the length of the text.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from types import MappingProxyType

from service.grading.judging.message_parts import quote_list, quote_text
from service.grading.judging.text_tokens import find_words, split_words
from service.language import translatable
from sim.sentences import Sentence, join_with_and
from submissions.criteria.expressions import has_match
from submissions.criteria.texts import TextConditions


def is_accepted_text(criterion: TextConditions, text: str) -> bool:
    """Return whether a text meets all given conditions."""
    fold = criterion.ignore_case
    normalised = normalise_text(text, fold)
    if criterion.equals and normalised not in [normalise_text(wanted, fold) for wanted in criterion.equals]:
        return False
    if criterion.starts_with and not normalised.startswith(
        tuple(normalise_text(w, fold) for w in criterion.starts_with)
    ):
        return False
    if not all(normalise_text(wanted, fold) in normalised for wanted in criterion.contains):
        return False
    if criterion.among and len(_find_named_choices(criterion.among, text)) != 1:
        return False
    return criterion.matches is None or has_match(text, criterion.matches, fold)


def describe_conditions(criterion: TextConditions) -> str:
    """Return the conditions in words: ``"x" or "y"``, ``something that contains "x"``; empty without conditions."""
    clauses = describe_clauses(criterion)
    if clauses:
        return Sentence("something that %(clauses)s", clauses=clauses)
    return quote_list(criterion.equals, "or") if criterion.equals else ""


def describe_clauses(criterion: TextConditions) -> str:
    """Return the conditions as clauses: ``contains "x" and ...``; empty if they are nothing but a list of texts."""
    clauses = []
    if criterion.starts_with:
        clauses.append(Sentence("starts with %(texts)s", texts=quote_list(criterion.starts_with, "or")))
    if criterion.contains:
        clauses.append(Sentence("contains %(texts)s", texts=quote_list(criterion.contains)))
    if criterion.among:
        clauses.append(Sentence("names only one of %(texts)s", texts=quote_list(criterion.among)))
    if criterion.matches is not None:
        clauses.append(Sentence("matches the pattern %(pattern)s", pattern=quote_text(criterion.matches)))
    if criterion.equals and clauses:
        clauses.insert(0, Sentence("is %(texts)s", texts=quote_list(criterion.equals, "or")))
    return join_with_and(clauses)


def is_same_text(text: str, expected: str, ignore_case: bool) -> bool:
    """Return whether two texts are equal apart from blanks at the ends, repeated blanks and, if requested, case."""
    return normalise_text(text, ignore_case) == normalise_text(expected, ignore_case)


def _find_named_choices(choices: Sequence[str], text: str) -> list[str]:
    """Return the choices that a text contains as whole words."""
    words = split_words(text)
    return [choice for choice in choices if find_words(words, split_words(choice)) is not None]


def normalise_text(text: str, ignore_case: bool) -> str:
    """Return a text with single blanks between its words and, if requested, in lower case."""
    normalised = " ".join(text.split())
    return normalised.casefold() if ignore_case else normalised


@dataclass(frozen=True, slots=True)
class TextWording:
    """The wording for a kind of text: a template for each method. ``addressed`` texts have a receiver, unlike prints.

    ``names`` are the values of the templates that are the same in all of them.
    """

    expected: str
    actual: str
    passed: str
    last: str
    misplaced: str
    addressed: bool = False
    names: Mapping[str, str] = field(default_factory=lambda: MappingProxyType({}))

    def describe_expected(self, texts: str) -> str:
        """Return a clause such as ``Expected the robot to say "a"``."""
        return Sentence(self.expected, texts=texts, **self.names)

    def describe_actual(self, texts: str) -> str:
        """Return a clause such as ``it said "a"``."""
        return Sentence(self.actual, texts=texts, **self.names)

    def describe_passed(self, texts: str) -> str:
        """Return a sentence such as ``The robot said "a".`` in full."""
        return Sentence(self.passed, texts=texts, **self.names)

    def describe_last(self) -> str:
        """Return a noun phrase such as ``last text that the robot said``."""
        return Sentence(self.last, **self.names)

    def describe_misplaced(self, count: int) -> str:
        """Return a clause such as ``such texts were said 3 times at the wrong point``."""
        return Sentence(self.misplaced, count=count, **self.names)


PRINT = TextWording(
    translatable("Expected the program to print %(texts)s"),
    translatable("it printed %(texts)s"),
    translatable("The program printed %(texts)s."),
    translatable("last text that the program printed"),
    translatable("such texts were printed %(count)s times at the wrong point"),
)
RESPONDER_PRINT = TextWording(
    translatable("Expected the responder to print %(texts)s"),
    translatable("it printed %(texts)s"),
    translatable("The responder printed %(texts)s."),
    translatable("last text that the responder printed"),
    translatable("such texts were printed %(count)s times at the wrong point"),
)
SPEECH = TextWording(
    translatable("Expected the robot to say %(texts)s"),
    translatable("it said %(texts)s"),
    translatable("The robot said %(texts)s."),
    translatable("last text that the robot said"),
    translatable("such texts were said %(count)s times at the wrong point"),
)
SENT_TEXT = TextWording(
    translatable("Expected the robot to send %(texts)s"),
    translatable("it sent %(texts)s"),
    translatable("The robot sent %(texts)s."),
    translatable("last text that the robot sent"),
    translatable("such texts were sent %(count)s times at the wrong point"),
    addressed=True,
)
RECEIVED_TEXT = TextWording(
    translatable("Expected the robot to receive %(texts)s"),
    translatable("it received %(texts)s"),
    translatable("The robot received %(texts)s."),
    translatable("last text that the robot received"),
    translatable("such texts were received %(count)s times at the wrong point"),
)
_AGENT_TEXT = TextWording(
    translatable("Expected the %(sender)s to tell the %(receiver)s %(texts)s"),
    translatable("it told the %(receiver)s %(texts)s"),
    translatable("The %(sender)s told the %(receiver)s %(texts)s."),
    translatable("last text that the %(sender)s told the %(receiver)s"),
    translatable("such texts were told the %(receiver)s %(count)s times at the wrong point"),
)


def build_agent_wording(sender: str, receiver: str) -> TextWording:
    """Return the wording for texts from one agent to another."""
    return replace(_AGENT_TEXT, names=MappingProxyType({"sender": sender, "receiver": receiver}))
