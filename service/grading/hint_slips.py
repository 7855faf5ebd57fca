"""Hints on slips that one statement proves: ``^`` as power, ``or "text"``, a missing comma, an empty range.

They are always mistakes, so they come before hints based on criteria.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Sequence

from service.grading.hint_clues import Clues, Listing
from service.grading.hint_code import CodeStatements, Statement, compute_bracket_depths, is_name, join_tokens
from service.grading.hint_loops import find_reading
from service.grading.hint_tables import READINGS
from service.grading.hint_variables import (
    check_early_step,
    check_mixed_sides,
    check_name_case,
    check_removal_in_loop,
    check_unreachable_if,
)

COMPARISONS = frozenset({"<", ">", "<=", ">=", "==", "!="})
_ORDER_SIGNS = frozenset({"<", ">", "<=", ">="})
#: Functions without arguments that students compare without calling them.
_PARAMETERLESS_FUNCTIONS = frozenset({"robot_number", "pyState", "get_clock"})
_TEXT = re.compile(r"""[fbru]{0,2}["']""", re.IGNORECASE)
_NUMBER = re.compile(r"\d+(?:\.\d+)?\Z")
_BEFORE_OPERAND = frozenset({"if", "while", "elif", "and", "or", "not", "(", "return", "="})
_AFTER_OPERAND = frozenset({":", ")", "and", "or"})
_LONGEST_ENTRY = 40
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
    if not any("IndexError: list index out of range" in fault.message for fault in clues.faults):
        return
    for listing in clues.texts:
        for statement in listing.code.statements:
            found = _check_missing_comma(listing, statement)
            if found:
                yield found
                return


def collect_slips(listing: Listing) -> Iterator[str]:
    """Yield all slips in a text."""
    for statement in listing.code.statements:
        for slip in _SLIP_CHECKS:
            found = slip(listing, statement)
            if found:
                yield found


def _check_caret(listing: Listing, statement: Statement) -> str:
    tokens = statement.tokens
    for before, token, after in zip(tokens, tokens[1:], tokens[2:], strict=False):
        if token == "^" and _NUMBER.match(after) and (is_name(before) or before == ")" or _NUMBER.match(before)):
            return f"{listing.locate(statement.line)}: ^ is not a power in Python. Write ** in place of ^"
    return ""


def _check_bitwise_operator(listing: Listing, statement: Statement) -> str:
    tokens, words = statement.tokens, {"&": "and", "|": "or"}
    levels = compute_bracket_depths(tokens)
    for place, token in enumerate(tokens):
        if token not in words:
            continue
        left, right = _split_operands(tokens, levels, place)
        compared = [each for each in (*left, *right) if each in COMPARISONS]
        if len(compared) > 1:
            return (
                f"{listing.locate(statement.line)}: {token} is calculated before {compared[0]}, so this does not "
                "ask for "
                f"both comparisons. Write {words[token]} in place of {token}"
            )
    return ""


def _check_constant_operand(listing: Listing, statement: Statement) -> str:
    """Return a hint on ``day == "Saturday" or "Sunday"``, where the second operand is not a comparison."""
    tokens = statement.tokens
    for place, token in enumerate(tokens[:-1]):
        value, after = tokens[place + 1], tokens[place + 2 : place + 3]
        literal = (_TEXT.match(value) and len(value) > 2) or (_NUMBER.match(value) and float(value))
        if token not in ("or", "and") or not literal or (after and after[0] not in _AFTER_OPERAND):
            continue
        begin = next((at + 1 for at in range(place - 1, -1, -1) if tokens[at] in _BEFORE_OPERAND), 0)
        left = tokens[begin:place]
        sign = next((at for at, each in enumerate(left) if each in COMPARISONS), None)
        if sign:
            whole = join_tokens((*left[: sign + 1], value))
            return (
                f"{listing.locate(statement.line)}: {value} after {token} is not compared, and is always true. "
                f"Write {token} {whole}"
            )
    return ""


def _check_bare_operand(listing: Listing, statement: Statement) -> str:
    """Return a hint on ``left and right < 25``, where the first operand is not a comparison."""
    tokens = statement.tokens
    for place in range(1, len(tokens) - 4):
        before, name, word, other, sign = tokens[place - 1 : place + 4]
        if word not in ("and", "or") or before not in _BEFORE_OPERAND or before == "=" or sign not in _ORDER_SIGNS:
            continue
        if is_name(name) and is_name(other) and name != other and _is_numeric_name(listing.code, name):
            number = tokens[place + 4]
            return (
                f"{listing.locate(statement.line)}: {name} {word} {other} {sign} {number} only asks whether "
                f"{name} is not "
                f"0. Write {name} {sign} {number} {word} {other} {sign} {number}"
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
    for place in range(1, len(tokens) - 1):
        one, other = tokens[place : place + 2]
        texts = _TEXT.match(one) and _TEXT.match(other) and max(len(one), len(other)) <= _LONGEST_ENTRY
        if not texts or levels[place] == 0:
            continue
        opening = next(at for at in range(place, -1, -1) if levels[at] < levels[place] or at == 0)
        inside = [at for at in range(opening + 1, len(tokens)) if levels[at] == levels[place]]
        if tokens[opening] in "[{" and any(tokens[at] == "," for at in inside):
            line = _find_line(listing, statement, one, other)
            return (
                f"{listing.locate(line)}: a comma is missing after {one}, so Python joins it to {other}. Add the comma"
            )
    return ""


def _find_line(listing: Listing, statement: Statement, one: str, other: str) -> int:
    """Return the line of the first of two adjacent texts."""
    for number in range(statement.line, min(statement.last_line, len(listing.lines)) + 1):
        text = listing.lines[number - 1]
        if one in text and (other in text or text.partition("#")[0].rstrip().endswith(one)):
            return number
    return statement.line


def _check_uncalled_function(listing: Listing, statement: Statement) -> str:
    tokens = statement.tokens
    for place, token in enumerate(tokens[:-1]):
        sign = tokens[place + 1]
        if token in _PARAMETERLESS_FUNCTIONS and sign in COMPARISONS:
            begin = place - 2 if place > 1 and tokens[place - 1] == "." else place
            name = join_tokens(tokens[begin : place + 1])
            compared = join_tokens(tokens[begin : place + 3])
            return (
                f"{listing.locate(statement.line)}: {token} is a function. Without brackets it is not called, so "
                f"{compared} does not compare its result. Write {name}()"
            )
    return ""


def _check_reading_as_text(listing: Listing, statement: Statement) -> str:
    """Return a hint on a sensor's number that is compared with a text."""
    tokens = statement.tokens
    for place in range(1, len(tokens) - 1):
        sign, text = tokens[place : place + 2]
        reading = find_reading(tokens[place - 1 : place], listing.code)
        if sign not in ("==", "!=") or not _TEXT.match(text) or reading not in READINGS:
            continue
        fix = "Write color_name in place of color" if reading == "color" else f"Write {text[1:-1]} without quotes"
        return f"{listing.locate(statement.line)}: {reading} is a number, and never equals the text {text}. {fix}"
    return ""


def _check_empty_range(listing: Listing, statement: Statement) -> str:
    call = next((each for each in statement.calls if each.name == "range"), None)
    if statement.keyword != "for" or call is None or len(call.arguments) < 2:
        return ""
    numbers = [listing.code.number(each) for each in call.arguments]
    begin, end, step = (*numbers, 1.0)[:3]
    if begin is None or end is None or not step or (end - begin) * step > 0:
        return ""
    shown = f"range({format_arguments(call.arguments)})"
    if step > 0 and begin > end:
        fix = f"To count down to {end:g}, write range({begin:g}, {end - 1:g}, -1)"
    elif step < 0 and begin < end:
        fix = f"To count up to {end:g}, write range({begin:g}, {end + 1:g})"
    else:
        fix = "The end is never reached: write a larger end" if step > 0 else "Write a smaller end"
    return f"{listing.locate(statement.line)}: {shown} is empty, so the loop never runs. {fix}"


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
    return f"{listing.locate(statement.line)}: {token} alone does nothing, and is not returned. Write return {token}"


def _check_chained_ifs(listing: Listing, statement: Statement) -> str:
    """Return a hint on ``if``, ``if``, ``else`` on the same reading, where the second should be ``elif``."""
    code = listing.code
    if statement.keyword != "if" or len(statement.condition) != 3 or statement.condition[1] not in _ORDER_SIGNS:
        return ""
    following = code.find_next_outside(statement)
    if following is None or following.keyword != "if" or following.indent != statement.indent:
        return ""
    last: Statement | None = following
    while last is not None and last.keyword in ("if", "elif") and last.condition[:2] == statement.condition[:2]:
        last = code.find_next_outside(last)
    ends = any(each.keyword in ("return", "break", "continue") for each in code.list_body(statement))
    first, second = (code.number(each.condition[2:]) for each in (statement, following))
    if last is None or last.keyword != "else" or last.indent != statement.indent or ends:
        return ""
    if following.condition[:2] != statement.condition[:2] or first is None or second is None:
        return ""
    if (first > second) != (statement.condition[1] in (">", ">=")):
        return ""
    return (
        f"{listing.locate(following.line)}: this if is also checked when the if in line {statement.line} was "
        "true, so both "
        "run. Write elif in place of if"
    )


def _split_operands(tokens: Sequence[str], levels: Sequence[int], place: int) -> tuple[list[str], list[str]]:
    """Return the tokens to the left and right of one, within the same bracket and operand."""
    stops = ("and", "or", ",", ":", "=", "return", "if", "while")

    def side(step: int) -> list[str]:
        found: list[str] = []
        at = place + step
        while 0 <= at < len(tokens) and levels[at] >= levels[place]:
            if levels[at] == levels[place]:
                if tokens[at] in stops:
                    break
                found.append(tokens[at])
            at += step
        return found

    return side(-1), side(1)


_SLIP_CHECKS: Sequence[_SlipCheck] = (
    check_name_case,
    check_mixed_sides,
    check_early_step,
    check_removal_in_loop,
    check_unreachable_if,
    _check_caret,
    _check_bitwise_operator,
    _check_constant_operand,
    _check_bare_operand,
    _check_missing_comma,
    _check_uncalled_function,
    _check_reading_as_text,
    _check_empty_range,
    _check_unused_value,
    _check_chained_ifs,
)
