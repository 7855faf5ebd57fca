"""Hints on functions that follow rules: a missing last branch, a border or a connective other than the rules have.

The rules are read from the assignment's description.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping

from service.grading.findings import WrongHiddenCalls, WrongReturn
from service.grading.hint_clues import Clues, Listing
from service.grading.hint_code import Statement, is_name, join_tokens
from service.language import translatable
from sim.sentences import Sentence
from submissions.criteria.code import Functions

_RULE = re.compile(
    r"\b(?:(?P<less>less than|below|under|fewer than|smaller than|lower than)"
    r"|(?P<more>more than|greater than|above|over|larger than|higher than)"
    r"|(?P<least>at least)|(?P<most>at most|up to)) (?P<number>\d+(?:\.\d+)?)"
)
#: Whether a number itself belongs to the upper side of the border in a rule.
_IS_UPPER = {"less": True, "more": False, "least": True, "most": False}
_SIGNS_OF_UPPER = {"<": True, ">=": True, ">": False, "<=": False}
_OTHER_BORDER = {"<": "<=", "<=": "<", ">": ">=", ">=": ">"}
_CONDITION_KEYWORDS = frozenset({"if", "elif", "while"})
_BOTH = re.compile(r"\bboth\b[^.;:]*", re.IGNORECASE)


def hint_about_rules(clues: Clues) -> Iterator[str]:
    """Yield where a function that lost marks differs from the rules in the description."""
    if not any(isinstance(each, Functions) for each in clues.lost):
        return
    for listing in clues.responders:
        for statement in listing.code.statements:
            hint = _describe_connective(listing, statement, clues.task) or _describe_border(
                listing, statement, _read_borders(clues.task)
            )
            if hint:
                yield hint
                return


def hint_about_missing_branch(clues: Clues) -> Iterator[str]:
    """Yield a hint on a function whose last ``if`` returns a value, if nothing is returned where it is false."""
    if not any(_has_missing_value(each, clues) for each in clues.lost if isinstance(each, Functions)):
        return
    for listing in clues.responders:
        for head in listing.code.list_functions():
            last = next((each for each in reversed(listing.code.list_body(head)) if each.parent == head.number), None)
            conditions = [
                each
                for each in listing.code.list_body(head)
                if each.parent == head.number and each.keyword in ("if", "elif") and _returns_value(listing, each)
            ]
            if last is None or len(conditions) < 2 or conditions[-1] is not last:
                continue
            yield Sentence(
                "%(place)s: if no condition is true, %(function)s returns nothing. Add a return for this case "
                "below, with the indentation of line %(line)s",
                place=listing.locate(last.last_line + _count_lines(listing, last)),
                function=head.tokens[1],
                line=last.line,
            )
            return


def _has_missing_value(criterion: Functions, clues: Clues) -> bool:
    wrong = clues.find_finding(criterion, WrongReturn)
    return clues.find_finding(criterion, WrongHiddenCalls) is not None or (wrong is not None and wrong.returned is None)


def _returns_value(listing: Listing, condition: Statement) -> bool:
    body = listing.code.list_body(condition)
    return bool(body) and body[-1].keyword == "return" and body[-1].tokens[1:] not in ((), ("None",))


def _count_lines(listing: Listing, condition: Statement) -> int:
    return listing.code.list_body(condition)[-1].line - condition.last_line


def _read_borders(task: str) -> Mapping[float, bool]:
    """Return for each number of the rules whether it belongs to the upper side; without numbers with both."""
    sides: dict[float, set[bool]] = {}
    for match in _RULE.finditer(" ".join(task.split())):
        kind = next(each for each in _IS_UPPER if match[each])
        sides.setdefault(float(match["number"]), set()).add(_IS_UPPER[kind])
    return {number: upper.pop() for number, upper in sides.items() if len(upper) == 1}


def _describe_border(listing: Listing, statement: Statement, borders: Mapping[float, bool]) -> str:
    """Return a hint on ``left <= 50`` where the rule says less than 50."""
    tokens = statement.tokens
    for index in range(1, len(tokens) - 1) if statement.keyword in _CONDITION_KEYWORDS else ():
        left, sign, right = tokens[index - 1 : index + 2]
        number = listing.code.number((right,)) if sign in _OTHER_BORDER and is_name(left) else None
        is_upper = None if number is None else borders.get(number)
        if is_upper is None or is_upper == _SIGNS_OF_UPPER[sign]:
            continue
        template = (
            translatable(
                "%(place)s: by %(code)s, %(number)g itself is on the lower side, and the rules put it on the upper "
                "side. Write %(fixed)s"
            )
            if is_upper
            else translatable(
                "%(place)s: by %(code)s, %(number)g itself is on the upper side, and the rules put it on the lower "
                "side. Write %(fixed)s"
            )
        )
        return Sentence(
            template,
            place=listing.locate(statement.line),
            code=join_tokens((left, sign, right)),
            number=number,
            fixed=join_tokens((left, _OTHER_BORDER[sign], right)),
        )
    return ""


def _describe_connective(listing: Listing, statement: Statement, task: str) -> str:
    """Return a hint on ``left < 25 or right < 25`` where the rule asks for both."""
    condition = statement.condition if statement.keyword in _CONDITION_KEYWORDS else ()
    if len(condition) != 7 or condition[3] != "or" or condition[1:3] != condition[5:7]:
        return ""
    number = listing.code.number(condition[2:3])
    rules = [match[0] for match in _BOTH.finditer(" ".join(task.split()))]
    numbers = {float(match["number"]) for rule in rules for match in _RULE.finditer(rule)}
    if number is None or number not in numbers or condition[0] == condition[4]:
        return ""
    return Sentence(
        "%(place)s: with or, one of %(first)s and %(second)s is enough, and the rule asks for both. Write and in place "
        "of or",
        place=listing.locate(statement.line),
        first=condition[0],
        second=condition[4],
    )
