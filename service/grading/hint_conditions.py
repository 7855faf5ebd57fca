"""Slips in conditions that the text proves: always true, never true, or a method without its brackets.

``hint_slips.py`` runs these rules with its own. ``advise_on_leaving`` says how the condition of a loop becomes false.
"""

from __future__ import annotations

import re
from collections.abc import Sequence

from service.grading.hint_clues import Listing
from service.grading.hint_code import Statement, is_name, iterate_equality_tests, join_tokens
from service.language import translatable
from sim.sentences import Sentence

_LITERAL = re.compile(r"""(["']).*\1\Z|\d+(?:\.\d+)?\Z|(?:True|False|None)\Z""")
_CONDITIONS = frozenset({"if", "elif", "while"})
_BEFORE_OPERAND = frozenset({"if", "elif", "while", "and", "or", "not", "("})
_AFTER_OPERAND = frozenset({":", ")", "and", "or"})
#: Methods without arguments whose result is a condition.
_PREDICATES = frozenset({"all", "any", "isalpha", "isdecimal", "isdigit", "islower", "isnumeric", "isspace", "isupper"})
_COLOUR_NAMES = ("NoColor", "Black", "Blue", "Green", "Yellow", "Red", "White", "Brown")


def check_contradiction(listing: Listing, statement: Statement) -> str:
    """Return a hint on ``day != "a" or day != "b"``, which is always true, and on ``==`` with ``and``."""
    tokens = statement.tokens
    for index, word in enumerate(tokens):
        left = _find_comparison_before(tokens, index) if word in ("or", "and") else None
        if left is None:
            continue
        subject, sign, value = left
        size = len(subject)
        right = tokens[index + 1 : index + size + 3]
        if (
            right[:size] != subject
            or right[size : size + 1] != (sign,)
            or (sign, word) not in (("!=", "or"), ("==", "and"))
        ):
            continue
        following = tokens[index + size + 3 : index + size + 4]
        if len(right) < size + 2 or not _LITERAL.match(right[-1]) or right[-1] == value:
            continue
        if following and following[0] not in _AFTER_OPERAND:
            continue
        template = (
            translatable(
                "%(place)s: %(condition)s is always true, because %(name)s differs from one of them. Write and in "
                "place of or"
            )
            if word == "or"
            else translatable(
                "%(place)s: %(condition)s is never true, because %(name)s cannot equal both. Write or in place of and"
            )
        )
        return Sentence(
            template,
            place=listing.locate(statement.line),
            condition=join_tokens((*subject, sign, value, word, *right)),
            name=join_tokens(subject),
        )
    return ""


def _find_comparison_before(tokens: Sequence[str], end: int) -> tuple[tuple[str, ...], str, str] | None:
    """Return name, sign and value of ``name == value`` that ends before an index; None for anything else."""
    if end < 4 or not _LITERAL.match(tokens[end - 1]) or tokens[end - 2] not in ("==", "!="):
        return None
    start = end - 3
    while start >= 2 and tokens[start - 1] == "." and is_name(tokens[start - 2]):
        start -= 2
    if not is_name(tokens[start]) or tokens[start - 1] not in _BEFORE_OPERAND or start == 0:
        return None
    return tuple(tokens[start : end - 2]), tokens[end - 2], tokens[end - 1]


def check_uncalled_predicate(listing: Listing, statement: Statement) -> str:
    """Return a hint on ``if shape.all:``, a method without brackets, which is always true."""
    tokens = statement.tokens
    for index in range(3, len(tokens) - 1) if statement.keyword in _CONDITIONS else ():
        owner, dot, method = tokens[index - 2 : index + 1]
        if method not in _PREDICATES or dot != "." or not is_name(owner) or tokens[index + 1] not in _AFTER_OPERAND:
            continue
        if any(each.keyword == "class" for each in listing.code.statements):
            continue
        return Sentence(
            "%(place)s: %(code)s is a function, and a function is always true. Write %(code)s()",
            place=listing.locate(statement.line),
            code=f"{owner}.{method}",
        )
    return ""


def check_colour_name(listing: Listing, statement: Statement) -> str:
    """Return a hint on ``color_name == "red"``, which is never true."""
    names = {each.target for each in listing.code.statements if each.target and each.tokens[-1] == "color_name"}
    for left, value in iterate_equality_tests(statement.tokens):
        name = left[-1]
        if value[:1] not in ("'", '"') or value[1:-1] in _COLOUR_NAMES:
            continue
        if name != "color_name" and name not in names:
            continue
        if any(name in each.bound_names and each.tokens[-1] != "color_name" for each in listing.code.statements):
            continue
        near = next((each for each in _COLOUR_NAMES if each.lower() == value[1:-1].strip().lower()), "")
        if near:
            return Sentence(
                '%(place)s: color_name has a capital letter, and never equals %(text)s. Write "%(name)s"',
                place=listing.locate(statement.line),
                text=value,
                name=near,
            )
        return Sentence(
            "%(place)s: color_name never equals %(text)s. It is one of %(names)s",
            place=listing.locate(statement.line),
            text=value,
            names=", ".join(_COLOUR_NAMES),
        )
    return ""


def advise_on_leaving(listing: Listing, loop: Statement) -> str:
    """Return how a loop ends when an answer is there: by its condition, if that names something, or by ``break``."""
    body = listing.code.list_body(loop)
    counters = {each.keyword for each in body if each.tokens[1:2] in (("+=",), ("-=",))}
    variables = {each.target for each in listing.code.statements} - counters - {""}
    names = [each for each in loop.condition if each in variables] if loop.keyword == "while" else []
    if not names:
        return Sentence(
            "Leave the loop in line %(line)s as soon as the answer is there, for example with break", line=loop.line
        )
    changing_line = next((each.line for name in names for each in body if each.target == name), None)
    if changing_line is None:
        return Sentence(
            "The loop in line %(line)s goes on while %(condition)s, and no line in it assigns a value to %(name)s",
            line=loop.line,
            condition=join_tokens(loop.condition),
            name=names[0],
        )
    return Sentence(
        "The loop in line %(line)s goes on while %(condition)s: check line %(other)s, which changes it",
        line=loop.line,
        condition=join_tokens(loop.condition),
        other=changing_line,
    )
