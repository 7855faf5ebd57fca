"""Hints on slips that one statement proves: ``^`` as power, ``or "text"``, a missing comma, an empty range.

They are always mistakes, so they come before hints based on criteria.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Sequence

from service.grading.fault_kinds import FaultKind, is_kind
from service.grading.hint_clues import Clues, Listing
from service.grading.hint_code import CodeStatements, Statement, compute_bracket_depths, is_name, join_tokens
from service.grading.hint_conditions import check_colour_name, check_contradiction, check_uncalled_predicate
from service.grading.hint_loops import find_reading
from service.grading.hint_operands import (
    check_decimal_comma,
    check_number_as_text,
    check_robot_number,
    check_second_text,
)
from service.grading.hint_tables import READINGS
from service.grading.hint_updates import UPDATE_CHECKS
from service.grading.hint_value_sources import describe_overwritten_list, is_overwritten_list
from service.grading.hint_variables import (
    check_early_step,
    check_mixed_sides,
    check_name_case,
    check_removal_in_loop,
    check_unreachable_if,
)
from service.grading.judging.message_parts import add_place
from service.language import translatable
from sim.sentences import Sentence

COMPARISONS = frozenset({"<", ">", "<=", ">=", "==", "!="})
_ORDER_SIGNS = frozenset({"<", ">", "<=", ">="})
#: Functions without arguments that students compare without calling them.
_PARAMETERLESS_FUNCTIONS = frozenset({"robot_number", "pyState", "get_clock"})
_TEXT = re.compile(r"""[fbru]{0,2}["']""", re.IGNORECASE)
_NUMBER = re.compile(r"\d+(?:\.\d+)?\Z")
_BEFORE_OPERAND = frozenset({"if", "while", "elif", "and", "or", "not", "(", "return", "="})
_AFTER_OPERAND = frozenset({":", ")", "and", "or"})
_MAX_ENTRY_LENGTH = 40
_SlipCheck = Callable[[Listing, Statement], str]


def hint_about_slips(clues: Clues) -> Iterator[str]:
    """Yield the first slip in any text, if marks were lost."""
    if not clues.lost:
        return
    for listing in clues.texts:
        for sentence in collect_slips(listing):
            yield sentence
            return


def hint_about_missing_comma(clues: Clues) -> Iterator[str]:
    """Yield a hint on a list with a missing comma, if a list index was out of range."""
    if not any(is_kind(fault, FaultKind.LIST_INDEX) for fault in clues.faults):
        return
    for listing in clues.texts:
        for statement in listing.code.statements:
            sentence = _check_missing_comma(listing, statement)
            if sentence:
                yield sentence
                return


def collect_slips(listing: Listing) -> Iterator[str]:
    """Yield all slips in a text."""
    for statement in listing.code.statements:
        for check in _SLIP_CHECKS:
            sentence = check(listing, statement)
            if sentence:
                yield sentence


def _check_overwritten_list(listing: Listing, statement: Statement) -> str:
    """Return a hint on ``found = found.append(day)``, which makes found None."""
    # Other objects, such as tables, have methods of the same name that return a new object.
    is_list = is_overwritten_list(statement) and any(
        each.target == statement.target and each.tokens[2] in ("[", "list") for each in listing.code.statements
    )
    if not is_list:
        return ""
    return add_place(listing.locate(statement.line), describe_overwritten_list(statement))


def _check_caret(listing: Listing, statement: Statement) -> str:
    tokens = statement.tokens
    for previous, token, following in zip(tokens, tokens[1:], tokens[2:], strict=False):
        if (
            token == "^"
            and _NUMBER.match(following)
            and (is_name(previous) or previous == ")" or _NUMBER.match(previous))
        ):
            return Sentence(
                "%(place)s: ^ is not a power in Python. Write ** instead of ^", place=listing.locate(statement.line)
            )
    return ""


def _check_bitwise_operator(listing: Listing, statement: Statement) -> str:
    tokens, keywords = statement.tokens, {"&": "and", "|": "or"}
    levels = compute_bracket_depths(tokens)
    for index, token in enumerate(tokens):
        if token not in keywords:
            continue
        left, right = _split_operands(tokens, levels, index)
        comparisons = [each for each in (*left, *right) if each in COMPARISONS]
        if len(comparisons) > 1:
            return Sentence(
                "%(place)s: %(sign)s is calculated before %(comparison)s, so this does not ask for both "
                "comparisons. Write %(right)s instead of %(sign)s",
                place=listing.locate(statement.line),
                sign=token,
                comparison=comparisons[0],
                right=keywords[token],
            )
    return ""


def _check_constant_operand(listing: Listing, statement: Statement) -> str:
    """Return a hint on ``day == "Saturday" or "Sunday"``, where the second operand is not a comparison."""
    tokens = statement.tokens
    for index, token in enumerate(tokens[:-1]):
        value, following = tokens[index + 1], tokens[index + 2 : index + 3]
        is_literal = (_TEXT.match(value) and len(value) > 2) or (_NUMBER.match(value) and float(value))
        if token not in ("or", "and") or not is_literal or (following and following[0] not in _AFTER_OPERAND):
            continue
        start = next((at + 1 for at in range(index - 1, -1, -1) if tokens[at] in _BEFORE_OPERAND), 0)
        left_operand = tokens[start:index]
        sign_index = next((at for at, each in enumerate(left_operand) if each in COMPARISONS), None)
        if sign_index:
            return Sentence(
                "%(place)s: %(value)s after %(word)s is not compared, and is always true. Write %(word)s "
                "%(comparison)s",
                place=listing.locate(statement.line),
                value=value,
                word=token,
                comparison=join_tokens((*left_operand[: sign_index + 1], value)),
            )
    return ""


def _check_bare_operand(listing: Listing, statement: Statement) -> str:
    """Return a hint on ``left and right < 25``, where the first operand is not a comparison."""
    tokens = statement.tokens
    for index in range(1, len(tokens) - 4):
        previous, first_name, connective, second_name, sign = tokens[index - 1 : index + 4]
        if (
            connective not in ("and", "or")
            or previous not in _BEFORE_OPERAND
            or previous == "="
            or sign not in _ORDER_SIGNS
        ):
            continue
        if (
            is_name(first_name)
            and is_name(second_name)
            and first_name != second_name
            and _is_numeric_name(listing.code, first_name)
        ):
            comparison = f"{sign} {tokens[index + 4]}"
            return Sentence(
                "%(place)s: %(code)s only asks whether %(name)s is not 0. Write %(right)s",
                place=listing.locate(statement.line),
                code=f"{first_name} {connective} {second_name} {comparison}",
                name=first_name,
                right=f"{first_name} {comparison} {connective} {second_name} {comparison}",
            )
    return ""


def _is_numeric_name(code: CodeStatements, name: str) -> bool:
    """Return whether a name is a reading, or is compared with ``<`` or ``>`` elsewhere."""
    if find_reading((name,), code):
        return True
    return any(
        name == token
        and (set(each.tokens[place + 1 : place + 2]) | set(each.tokens[max(place - 1, 0) : place])) & _ORDER_SIGNS
        for each in code.statements
        for place, token in enumerate(each.tokens)
    )


def _check_missing_comma(listing: Listing, statement: Statement) -> str:
    tokens = statement.tokens
    levels = compute_bracket_depths(tokens)
    for index in range(1, len(tokens) - 1):
        first_text, second_text = tokens[index : index + 2]
        is_text_pair = (
            _TEXT.match(first_text)
            and _TEXT.match(second_text)
            and max(len(first_text), len(second_text)) <= _MAX_ENTRY_LENGTH
        )
        if not is_text_pair or levels[index] == 0:
            continue
        opening_index = next(at for at in range(index, -1, -1) if levels[at] < levels[index] or at == 0)
        inner_indices = [at for at in range(opening_index + 1, len(tokens)) if levels[at] == levels[index]]
        if tokens[opening_index] in "[{" and any(tokens[at] == "," for at in inner_indices):
            line = _find_line(listing, statement, first_text, second_text)
            return Sentence(
                "%(place)s: a comma is missing after %(first)s, so Python joins it to %(second)s. Add the comma",
                place=listing.locate(line),
                first=first_text,
                second=second_text,
            )
    return ""


def _find_line(listing: Listing, statement: Statement, first_text: str, second_text: str) -> int:
    """Return the line of the first of two adjacent texts."""
    for number in range(statement.line, min(statement.last_line, len(listing.lines)) + 1):
        text = listing.lines[number - 1]
        if first_text in text and (second_text in text or text.partition("#")[0].rstrip().endswith(first_text)):
            return number
    return statement.line


def _check_uncalled_function(listing: Listing, statement: Statement) -> str:
    tokens = statement.tokens
    for index, token in enumerate(tokens[:-1]):
        sign = tokens[index + 1]
        if token in _PARAMETERLESS_FUNCTIONS and sign in COMPARISONS:
            start = index - 2 if index > 1 and tokens[index - 1] == "." else index
            name = join_tokens(tokens[start : index + 1])
            comparison = join_tokens(tokens[start : index + 3])
            return Sentence(
                "%(place)s: %(function)s is a function. Without brackets it is not called, so %(comparison)s does "
                "not compare its result. Write %(name)s()",
                place=listing.locate(statement.line),
                function=token,
                comparison=comparison,
                name=name,
            )
    return ""


def _check_reading_as_text(listing: Listing, statement: Statement) -> str:
    """Return a hint on a sensor's number that is compared with a text."""
    tokens = statement.tokens
    for index in range(1, len(tokens) - 1):
        sign, text = tokens[index : index + 2]
        reading = find_reading(tokens[index - 1 : index], listing.code)
        if sign not in ("==", "!=") or not _TEXT.match(text) or reading not in READINGS:
            continue
        template = (
            translatable(
                "%(place)s: %(name)s is a number, and never equals the text %(text)s. Write color_name instead of color"
            )
            if reading == "color"
            else translatable(
                "%(place)s: %(name)s is a number, and never equals the text %(text)s. Write %(number)s without quotes"
            )
        )
        return Sentence(template, place=listing.locate(statement.line), name=reading, text=text, number=text[1:-1])
    return ""


def _check_empty_range(listing: Listing, statement: Statement) -> str:
    call = next((each for each in statement.calls if each.name == "range"), None)
    if statement.keyword != "for" or call is None or len(call.arguments) < 2:
        return ""
    numbers = [listing.code.number(each) for each in call.arguments]
    start, end, step = (*numbers, 1.0)[:3]
    if start is None or end is None or not step or (end - start) * step > 0:
        return ""
    if step > 0 and start > end:
        fix = Sentence(
            "To count down to %(end)g, write range(%(start)g, %(limit)g, -1)", end=end, start=start, limit=end - 1
        )
    elif step < 0 and start < end:
        fix = Sentence("To count up to %(end)g, write range(%(start)g, %(limit)g)", end=end, start=start, limit=end + 1)
    elif step > 0:
        fix = Sentence("The end is never reached: write a larger end")
    else:
        fix = Sentence("Write a smaller end")
    return Sentence(
        "%(place)s: range(%(arguments)s) is empty, so the loop never runs. %(advice)s",
        place=listing.locate(statement.line),
        arguments=format_arguments(call.arguments),
        advice=fix,
    )


def format_arguments(arguments: Sequence[Sequence[str]]) -> str:
    """Return the arguments of a call as code."""
    return ", ".join(
        f"{each[0]}={join_tokens(each[2:])}" if each[1:2] == ("=",) else join_tokens(each) for each in arguments
    )


def _check_unused_value(listing: Listing, statement: Statement) -> str:
    """Return a hint on a name or text alone on a line of a function: a forgotten ``return``."""
    head = next((each for each in listing.code.list_enclosing(statement) if each.keyword == "def"), None)
    if head is None or len(statement.tokens) != 1:
        return ""
    token, body = statement.tokens[0], listing.code.list_body(head)
    is_value = is_name(token) and (token in head.tokens or any(token in each.bound_names for each in body))
    is_text = token[:1] in "fF" and _TEXT.match(token) is not None
    if not (is_value or is_text):
        return ""
    return Sentence(
        "%(place)s: %(code)s alone does nothing, and is not returned. Write return %(code)s",
        place=listing.locate(statement.line),
        code=token,
    )


def _check_chained_ifs(listing: Listing, statement: Statement) -> str:
    """Return a hint on ``if``, ``if``, ``else`` on the same reading, where the second should be ``elif``."""
    code = listing.code
    if statement.keyword != "if" or len(statement.condition) != 3 or statement.condition[1] not in _ORDER_SIGNS:
        return ""
    next_statement = code.find_next_outside(statement)
    if next_statement is None or next_statement.keyword != "if" or next_statement.indent != statement.indent:
        return ""
    next_branch: Statement | None = next_statement
    while (
        next_branch is not None
        and next_branch.keyword in ("if", "elif")
        and next_branch.condition[:2] == statement.condition[:2]
    ):
        next_branch = code.find_next_outside(next_branch)
    has_exit = any(each.keyword in ("return", "break", "continue") for each in code.list_body(statement))
    first_limit, second_limit = (code.number(each.condition[2:]) for each in (statement, next_statement))
    if next_branch is None or next_branch.keyword != "else" or next_branch.indent != statement.indent or has_exit:
        return ""
    if next_statement.condition[:2] != statement.condition[:2] or first_limit is None or second_limit is None:
        return ""
    if (first_limit > second_limit) != (statement.condition[1] in (">", ">=")):
        return ""
    return Sentence(
        "%(place)s: this if is also checked when the if in line %(line)s was true, so both run. Write elif "
        "instead of if",
        place=listing.locate(next_statement.line),
        line=statement.line,
    )


def _split_operands(tokens: Sequence[str], levels: Sequence[int], index: int) -> tuple[list[str], list[str]]:
    """Return the tokens to the left and right of one, within the same bracket and operand."""
    stops = ("and", "or", ",", ":", "=", "return", "if", "while")

    def collect_operand(step: int) -> list[str]:
        operand: list[str] = []
        position = index + step
        while 0 <= position < len(tokens) and levels[position] >= levels[index]:
            if levels[position] == levels[index]:
                if tokens[position] in stops:
                    break
                operand.append(tokens[position])
            position += step
        return operand

    return collect_operand(-1), collect_operand(1)


_SLIP_CHECKS: Sequence[_SlipCheck] = (
    check_name_case,
    check_mixed_sides,
    check_early_step,
    check_removal_in_loop,
    check_unreachable_if,
    _check_overwritten_list,
    check_contradiction,
    check_uncalled_predicate,
    check_colour_name,
    _check_caret,
    _check_bitwise_operator,
    _check_constant_operand,
    _check_bare_operand,
    _check_missing_comma,
    _check_uncalled_function,
    _check_reading_as_text,
    check_robot_number,
    check_decimal_comma,
    check_number_as_text,
    check_second_text,
    _check_empty_range,
    _check_unused_value,
    _check_chained_ifs,
    *UPDATE_CHECKS,
)
