"""Advice on values that are missing or of the wrong kind, from the lines that they come from.

Examples: None that no line replaced, a loop's variable used above the loop, a whole list given to a function.
"""

from __future__ import annotations

import re
from collections.abc import Sequence

from service.grading.fault_kinds import FaultKind, is_kind, read_values
from service.grading.hint_clues import Clues, Listing
from service.grading.hint_code import Statement, is_name, join_tokens
from service.grading.hint_tables import USAGE
from sim.recording import Fault
from sim.sentences import Sentence, join_sentences

_DIGITS = re.compile(r"""["'](-?\d+(?:\.\d+)?)["']\Z""")
#: Methods of lists that change the list and return None.
_LIST_METHODS = frozenset({"append", "extend", "insert", "remove", "reverse", "sort"})
_OPERATORS = frozenset({"+", "-", "*", "/"})


def advise_on_quoted_amount(fault: Fault, _: Clues, __: Listing | None, statement: Statement | None) -> str:
    """Return advice on a number in quotes that is given to a motor."""
    if statement is None or not is_kind(fault, FaultKind.TEXT_OPERAND, FaultKind.LIST_OPERAND):
        return ""
    for call in statement.calls:
        for argument in call.arguments if call.name in USAGE else ():
            match = _DIGITS.match(argument[-1]) if len(argument) in (1, 3) else None
            if match is not None:
                return Sentence(
                    "%(text)s is a text, because it is in quotes. Write %(number)s.", text=match[0], number=match[1]
                )
    return ""


def advise_on_list_argument(fault: Fault, _: Clues, listing: Listing | None, statement: Statement | None) -> str:
    """Return advice on a function of the student that is given a whole list, and calculates with it."""
    if listing is None or statement is None or not is_kind(fault, FaultKind.LIST_OPERAND):
        return ""
    head = next((each for each in listing.code.list_enclosing(statement) if each.keyword == "def"), None)
    function = head.tokens[1] if head is not None and len(head.tokens) > 1 else ""
    for caller in listing.code.statements:
        for call in caller.calls if function else ():
            argument = next((each for each in call.arguments if each[0] == "[" and each[-1] == "]"), None)
            if call.name == function and argument is not None:
                return Sentence(
                    "Line %(line)s gives %(function)s a whole list. Call it once for each entry: for value in "
                    "%(entries)s: and below it %(function)s(value).",
                    line=caller.line,
                    function=function,
                    entries=join_tokens(argument),
                )
    return ""


def advise_on_later_loop(fault: Fault, _: Clues, listing: Listing | None, statement: Statement | None) -> str:
    """Return advice on a name that a loop below the line gives its values."""
    values = read_values(fault, FaultKind.UNDEFINED_NAME)
    if values is None or listing is None or statement is None:
        return ""
    for loop in listing.code.list_following(statement):
        names = loop.tokens[1 : loop.tokens.index("in")] if loop.keyword == "for" and "in" in loop.tokens else ()
        if loop.parent == statement.parent and values[0] in names:
            return Sentence(
                "%(name)s gets its values from the loop in line %(loop)s. Move line %(line)s into the loop, below line "
                "%(loop)s.",
                name=values[0],
                loop=loop.line,
                line=statement.line,
            )
    return ""


def advise_on_none(fault: Fault, _: Clues, listing: Listing | None, statement: Statement | None) -> str:
    """Return advice on a variable that is None, from the line that made it None or that should have replaced it."""
    if listing is None or statement is None or not is_kind(fault, FaultKind.NONE_OBJECT, FaultKind.NONE_OPERAND):
        return ""
    advice = [
        found
        for token in dict.fromkeys(statement.tokens)
        if is_name(token) and (found := _explain_none(token, listing)) is not None
    ]
    # A condition that is never true comes before one that waits for its result.
    values = read_values(fault, FaultKind.NONE_OPERAND)
    if values is not None and values != ("NoneType", "NoneType") and len(advice) > 1:
        return ""  # only one of them is None
    first = next((each for each in advice if each[1]), advice[0] if advice else None)
    return "" if first is None else join_sentences(*filter(None, first))


def _explain_none(name: str, listing: Listing) -> tuple[str, str] | None:
    """Return why a name is None, and what is wrong in the condition that should have changed it (empty if unclear)."""
    statements = listing.code.statements
    assignments = [each for each in statements if each.target == name]
    overwrite = next((each for each in assignments if is_overwritten_list(each)), None)
    if overwrite is not None:
        return describe_overwritten_list(overwrite), ""
    initial = next((each for each in assignments if each.tokens[2:] == ("None",)), None)
    later = [each for each in assignments if each is not initial]
    is_bound_otherwise = any(name in each.bound_names and not each.target for each in statements)
    if initial is None or len(later) != 1 or is_bound_otherwise:
        return None
    enclosing = listing.code.list_enclosing(later[0])
    head = next((each for each in enclosing if each.keyword in ("if", "elif", "while")), None)
    if head is None or head.indent < initial.indent:
        return None
    advice = Sentence(
        "%(name)s is still None, from line %(initial)s: line %(later)s has not run. Check the condition in line "
        "%(head)s, %(condition)s.",
        name=name,
        initial=initial.line,
        later=later[0].line,
        head=head.line,
        condition=join_tokens(head.condition),
    )
    return advice, _describe_none_comparison(name, head.condition)


def _describe_none_comparison(name: str, condition: Sequence[str]) -> str:
    """Return that None equals no number or text, if the condition compares the name with one."""
    for first, sign, value in zip(condition, condition[1:], condition[2:], strict=False):
        if first == name and sign == "==" and (value[:1].isdigit() or value[:1] in "\"'"):
            return Sentence("None never equals %(value)s: write %(name)s is None.", value=value, name=name)
    return ""


def is_overwritten_list(statement: Statement) -> bool:
    """Return whether a statement is ``x = x.append(...)`` or the like."""
    name, tokens = statement.target, statement.tokens
    return bool(name) and tokens[2:4] == (name, ".") and tokens[4:5] != () and _is_list_method(tokens)


def _is_list_method(tokens: Sequence[str]) -> bool:
    return tokens[4] in _LIST_METHODS and tokens[5:6] == ("(",) and tokens[-1] == ")"


def describe_overwritten_list(statement: Statement) -> str:
    """Return a sentence on ``x = x.append(...)``, which makes x None."""
    return Sentence(
        "%(method)s changes the list and returns None, so line %(line)s makes %(name)s None. Write %(code)s alone "
        "there.",
        method=statement.tokens[4],
        line=statement.line,
        name=statement.target,
        code=join_tokens(statement.tokens[2:]),
    )


def advise_on_last_index(fault: Fault, _: Clues, listing: Listing | None, statement: Statement | None) -> str:
    """Return advice on a loop that goes one beyond the end of a list: ``<= len(x)``, or ``range(len(x) + 1)``."""
    if listing is None or statement is None or not is_kind(fault, FaultKind.LIST_INDEX):
        return ""
    for loop in listing.code.list_enclosing_loops(statement):
        tokens = loop.tokens
        for index, token in enumerate(tokens):
            size = join_tokens(tokens[index + 1 : index + 5])
            if token == "<=" and loop.keyword == "while" and re.fullmatch(r"len\(\w+\)", size):
                return Sentence(
                    "The last index is %(size)s - 1. Write < in place of <= in line %(line)s.",
                    size=size,
                    line=loop.line,
                )
            is_longer = tokens[index + 5 : index + 7] == ("+", "1") and loop.keyword == "for"
            if is_longer and re.fullmatch(r"len\(\w+\)", size):
                return Sentence(
                    "The last index is %(size)s - 1. Remove + 1 after %(size)s in line %(line)s.",
                    size=size,
                    line=loop.line,
                )
    return ""


def advise_on_percentage(fault: Fault, _: Clues, __: Listing | None, statement: Statement | None) -> str:
    """Return advice on a calculated speed beyond 100."""
    values = read_values(fault, FaultKind.BAD_PERCENTAGE)
    if values is None or statement is None:
        return ""
    for call in statement.calls:
        argument = call.arguments[0] if call.name == "SpeedPercent" and call.arguments else ()
        if len(argument) > 2 and set(argument) & _OPERATORS:
            code = join_tokens(argument)
            return Sentence(
                "The speed is calculated. Make the numbers in it smaller, or limit each one from -100 to 100, as in "
                "SpeedPercent(max(-100, min(100, %(code)s))).",
                code=code,
            )
    return ""


def advise_on_unsent_message(fault: Fault, clues: Clues, _: Listing | None, statement: Statement | None) -> str:
    """Return advice on an empty queue of a program that prints texts, but sends none of them."""
    is_queue = statement is not None and statement.has_token("pyState")
    if fault.who != "program" or not is_queue or clues.sent or not clues.printed:
        return ""
    return Sentence(
        'The robot sent nothing, so no answer came. A message begins with PY::, as in print("PY::" + text).'
    )
