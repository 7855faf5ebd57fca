"""Hints on programs that count from another number, in other steps, or repeat their moves once too seldom.

The numbers come from what the robot said, or from the finding on the path.
"""

from __future__ import annotations

import re
from collections.abc import Iterator

from service.grading.findings import OtherWord
from service.grading.hint_clues import Clues
from service.grading.hint_code import LOOPS, Statement, join_tokens
from service.grading.hint_slips import format_arguments
from service.grading.hint_structure import DRIVING_CRITERIA, collect_statements, has_motor_call
from service.grading.hint_tables import LIMITED_MOVES, OUTPUT_FUNCTIONS
from sim.sentences import Sentence, iterate_values

_INTEGER = re.compile(r"-?\d{1,6}")
_MAX_PARTS = 50


def hint_about_first_number(clues: Clues) -> Iterator[str]:
    """Yield a hint on a count that begins with another number than the required one."""
    for criterion in clues.lost:
        word = clues.find_finding(criterion, OtherWord)
        if word is None or word.previous or not word.expected:
            continue
        if not _INTEGER.fullmatch(word.actual) or not _INTEGER.fullmatch(word.expected[0]):
            continue
        actual, expected = int(word.actual), int(word.expected[0])
        if abs(expected - actual) != 1:
            return
        hint = _describe_first_range(clues, actual, expected) or _describe_first_count(clues, actual, expected)
        if hint:
            yield hint
        return


def _describe_first_range(clues: Clues, actual: int, expected: int) -> str:
    for listing, statement in collect_statements(clues):
        call = next((each for each in statement.calls if each.name == "range"), None)
        if (
            statement.keyword != "for"
            or call is None
            or not _writes(statement.tokens[1], listing.code.list_body(statement))
        ):
            continue
        numbers = [listing.code.number(each) for each in call.arguments]
        if len(numbers) != 1 or numbers[0] is None or (actual, expected) != (0, 1):
            return ""
        return Sentence(
            "%(place)s: range(%(arguments)s) begins with %(actual)s, and %(expected)s is expected first. Write "
            "range(%(fixed)s)",
            place=listing.locate(statement.line),
            arguments=format_arguments(call.arguments),
            actual=actual,
            expected=expected,
            fixed=f"1, {numbers[0] + 1:g}",
        )
    return ""


def _describe_first_count(clues: Clues, actual: int, expected: int) -> str:
    for listing, statement in collect_statements(clues):
        name, start = statement.target, listing.code.number(statement.tokens[2:])
        if not name or start is None or statement.parent >= 0 or not _writes(name, listing.code.statements):
            continue
        steps = [each for each in listing.code.statements if each is not statement and name in each.bound_names]
        if len(steps) != 1 or not any(each.keyword in LOOPS for each in listing.code.list_enclosing(steps[0])):
            continue
        return Sentence(
            "%(place)s: %(name)s begins with %(start)g, so the first number is %(actual)s and not %(expected)s. Write "
            "%(name)s = %(fixed)g",
            place=listing.locate(statement.line),
            name=name,
            start=start,
            actual=actual,
            expected=expected,
            fixed=start + expected - actual,
        )
    return ""


def hint_about_count_step(clues: Clues) -> Iterator[str]:
    """Yield a hint on ``count = count - 2`` where each number is required."""
    for criterion in clues.lost:
        word = clues.find_finding(criterion, OtherWord)
        words = (word.previous[0], word.actual, word.expected[0]) if word and len(word.previous) == 1 else ()
        if not words or not all(map(_INTEGER.fullmatch, words)):
            continue
        previous, actual, expected = map(int, words)
        for listing, statement in collect_statements(clues):
            name, tokens = statement.tokens[0], statement.tokens
            sign = "+" if actual > previous else "-"
            amount = str(abs(actual - previous))
            is_step = tokens[1:] in (("=", name, sign, amount), (f"{sign}=", amount))
            if is_step and (expected > previous) == (actual > previous) and _writes(name, listing.code.statements):
                yield Sentence(
                    "%(place)s: %(code)s counts in steps of %(amount)s, so %(actual)s comes after %(previous)s, and "
                    "not %(expected)s. Write %(fixed)s",
                    place=listing.locate(statement.line),
                    code=join_tokens(tokens),
                    amount=amount,
                    actual=actual,
                    previous=previous,
                    expected=expected,
                    fixed=join_tokens((*tokens[:-1], str(abs(expected - previous)))),
                )
                return


def hint_about_pass_count(clues: Clues) -> Iterator[str]:
    """Yield a hint on ``range(3)`` around the moves of a figure that needs one pass more."""
    for criterion in clues.costliest_criteria[:1]:
        result = next(each for each in clues.results if each.id == criterion.id)
        values = (
            [value for _, value in iterate_values(result.message)] if isinstance(criterion, DRIVING_CRITERIA) else []
        )
        numbers = {int(str(each)) for each in values if _INTEGER.fullmatch(str(each))}
        for listing, statement in collect_statements(clues):
            call = next((each for each in statement.calls if each.name == "range"), None)
            body = listing.code.list_body(statement) if statement.keyword == "for" else ()
            count = listing.code.number(call.arguments[0]) if call is not None and len(call.arguments) == 1 else None
            is_moving = any(has_motor_call(each, LIMITED_MOVES) for each in body)
            if not count or not is_moving or any(each.has_token(statement.tokens[1]) for each in body):
                continue
            right = int(count) + 1
            pairs = [(had, had * right // int(count)) for had in numbers if had % int(count) == 0]
            # The numbers of figures and of their sides may be such a pair by chance, so both must be larger.
            if any(needed in numbers and right < had <= _MAX_PARTS for had, needed in pairs):
                yield Sentence(
                    "%(place)s: the loop runs %(count)g times, and %(right)s are needed. Write range(%(right)s)",
                    place=listing.locate(statement.line),
                    count=count,
                    right=right,
                )
                return


def _writes(name: str, statements: tuple[Statement, ...]) -> bool:
    """Return whether a statement says or prints a name."""
    return any(
        each.has_token(name) and any(call.name in OUTPUT_FUNCTIONS for call in each.calls) for each in statements
    )
