"""Conditions on one text: whether a text meets them, and their wording.

The texts come from students, the patterns from instructors. Matching takes time linear in the length of the text.
"""

from __future__ import annotations

from collections.abc import Sequence

from service.grading.judging.message_parts import quote_list, quote_text
from service.grading.judging.text_tokens import find_words, split_words
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
