"""Slips with variables that one program's text proves: wrong case, wrong side's sensor, a step too early.

``hint_slips.py`` runs these rules with its own.
"""

from __future__ import annotations

import re

from service.grading.hint_clues import Listing
from service.grading.hint_code import Statement, is_name, join_tokens
from service.language import translatable
from sim.sentences import Sentence

_SIDE = re.compile("left|right", re.IGNORECASE)
_OTHER_SIDE = {"left": "right", "right": "left", "Left": "Right", "Right": "Left", "LEFT": "RIGHT", "RIGHT": "LEFT"}


def check_name_case(listing: Listing, statement: Statement) -> str:
    """Return a hint on ``Count = count + 1``: an unread name that differs from another only in case."""
    name, tokens = statement.target, statement.tokens
    intended_name = next((each for each in tokens[2:] if each != name and each.casefold() == name.casefold()), "")
    statements = listing.code.statements
    if not name or not is_name(intended_name) or not any(each.target == intended_name for each in statements):
        return ""
    if any(name in (each.tokens[1:] if each.target == name else each.tokens) for each in statements):
        return ""
    return Sentence(
        "%(place)s assigns %(name)s, so %(intended)s stays as it is: upper and lower case are different. Write "
        "%(intended)s = %(code)s",
        place=listing.locate(statement.line),
        name=name,
        intended=intended_name,
        code=join_tokens(tokens[2:]),
    )


def check_mixed_sides(listing: Listing, statement: Statement) -> str:
    """Return a hint on a name with right in it that is assigned a value from the left, or the reverse."""
    name, value = statement.target, statement.tokens[2:]
    twin = _swap_sides(name)
    fixed_tokens = tuple(_swap_sides(token) if is_name(token) else token for token in value)
    sides = {side.lower() for token in value if is_name(token) for side in _SIDE.findall(token)}
    name_sides = {side.lower() for side in _SIDE.findall(name)}
    if len(name_sides) != 1 or len(sides) != 1 or name_sides == sides:
        return ""
    twin_assignment = next(
        (each for each in listing.code.statements if each.target == twin and each.tokens[2:] == value), None
    )
    if twin_assignment is None:
        return ""
    repeated_lines = [each.line for each in listing.code.statements if each.target == name and each.tokens[2:] == value]
    template = (
        translatable("%(place)s gives %(name)s the same value as %(twin)s in line %(line)s: %(code)s. Write %(fixed)s")
        if len(repeated_lines) < 2
        else translatable(
            "%(place)s gives %(name)s the same value as %(twin)s in line %(line)s: %(code)s. Write %(fixed)s in lines "
            "%(lines)s and %(last)s"
        )
    )
    return Sentence(
        template,
        place=listing.locate(statement.line),
        name=name,
        twin=twin,
        line=twin_assignment.line,
        code=join_tokens(value),
        fixed=f"{name} = {join_tokens(fixed_tokens)}",
        lines=", ".join(map(str, repeated_lines[:-1])),
        last=repeated_lines[-1],
    )


def check_early_step(listing: Listing, statement: Statement) -> str:
    """Return a hint on ``tosses[count]`` after ``count = count + 1`` in ``while count < len(tosses)``."""
    code = listing.code
    loop = next((each for each in code.list_enclosing(statement) if each.keyword == "while"), None)
    if loop is None or len(loop.condition) != 6 or loop.condition[1:4] != ("<", "len", "("):
        return ""
    name, items = loop.condition[0], loop.condition[4]
    item_index = next(
        (
            at
            for at in range(len(statement.tokens) - 3)
            if statement.tokens[at : at + 4] == _build_item_tokens(items, name)
        ),
        None,
    )
    assignments = [each for each in code.statements[: loop.number] if each.target == name][-1:]
    steps = [each for each in code.list_body(loop) if name in each.bound_names]
    if item_index is None or not assignments or assignments[0].tokens[2:] != ("0",) or len(steps) != 1:
        return ""
    step = steps[0]
    is_increment = step.tokens[1:] in (("+=", "1"), ("=", name, "+", "1"))
    if not is_increment or step.parent != loop.number or step.number >= statement.number:
        return ""
    return Sentence(
        "%(place)s: line %(line)s has already added 1 to %(name)s, so %(items)s[%(name)s] skips the first item "
        "and goes past the last. Write %(items)s[%(name)s - 1]",
        place=listing.locate(statement.line),
        line=step.line,
        name=name,
        items=items,
    )


def check_removal_in_loop(listing: Listing, statement: Statement) -> str:
    """Return a hint on ``days.remove(day)`` in ``for day in days``, which skips the item after each removal."""
    tokens, code = statement.tokens, listing.code
    loop = next((each for each in code.list_enclosing(statement) if each.keyword == "for"), None)
    if loop is None or len(loop.tokens) != 5 or tokens[1:4] != (".", "remove", "(") or tokens[0] != loop.tokens[3]:
        return ""
    following = code.statements[statement.number + 1 : statement.number + 2]
    if following and following[0].keyword in ("break", "return") and following[0].parent == statement.parent:
        return ""
    name, items = loop.tokens[1], loop.tokens[3]
    return Sentence(
        "%(place)s removes from %(items)s, the list that the loop in line %(line)s goes through, so the loop "
        "skips the item after it. Append each %(name)s that is kept to a new list",
        place=listing.locate(statement.line),
        items=items,
        line=loop.line,
        name=name,
    )


def check_unreachable_if(listing: Listing, statement: Statement) -> str:
    """Return a hint on ``if a < 5 and b < 5`` after an ``if a < 9`` that returns: the second is never true."""
    code, conjuncts = listing.code, _parse_conjuncts(statement)
    in_chain = statement.keyword == "elif"
    for earlier_statement in reversed(code.statements[: statement.number]) if conjuncts else ():
        if earlier_statement.indent < statement.indent or (
            earlier_statement.parent == statement.parent and earlier_statement.keyword not in ("if", "elif")
        ):
            return ""
        if earlier_statement.parent != statement.parent:
            if (
                any(one[0] in earlier_statement.bound_names for one in conjuncts)
                and earlier_statement.keyword not in _EXIT_KEYWORDS
            ):
                return ""
            continue
        body, earlier_conjuncts = code.list_body(earlier_statement), _parse_conjuncts(earlier_statement)
        alternatives = _parse_comparisons(earlier_statement, "or")
        is_exit = bool(body) and body[-1].parent == earlier_statement.number and body[-1].keyword in _EXIT_KEYWORDS
        if (in_chain or is_exit) and any(_implies(one, other) for one in conjuncts for other in alternatives[1:]):
            return Sentence(
                "%(place)s is never true: line %(line)s has already found that %(condition)s. Remove what line "
                "%(later)s asks from line %(line)s, or move line %(later)s above it",
                place=listing.locate(statement.line),
                line=earlier_statement.line,
                condition=join_tokens(earlier_statement.condition),
                later=statement.line,
            )
        if (
            (in_chain or is_exit)
            and earlier_conjuncts
            and all(any(_implies(one, other) for one in conjuncts) for other in earlier_conjuncts)
        ):
            return Sentence(
                "%(place)s is never true: wherever %(later)s, line %(line)s has already found that "
                "%(earlier)s. Move this condition above line %(line)s",
                place=listing.locate(statement.line),
                later=join_tokens(statement.condition),
                line=earlier_statement.line,
                earlier=join_tokens(earlier_statement.condition),
            )
        in_chain = in_chain and earlier_statement.keyword == "elif"
    return ""


_EXIT_KEYWORDS = frozenset({"return", "break", "continue", "raise"})
_Comparison = tuple[str, str, str]


def _parse_conjuncts(statement: Statement) -> list[_Comparison]:
    """Return the name comparisons that ``and`` joins in a condition. Empty if it contains anything else."""
    return _parse_comparisons(statement, "and")


def _parse_comparisons(statement: Statement, word: str) -> list[_Comparison]:
    """Return the name comparisons that ``word`` joins in a condition. Empty if it contains anything else."""
    if statement.keyword not in ("if", "elif"):
        return []
    parts: list[tuple[str, ...]] = [()]
    for token in statement.condition:
        parts = [*parts, ()] if token == word else [*parts[:-1], (*parts[-1], token)]
    comparisons = [
        (each[0], each[1], each[2]) for each in parts if len(each) == 3 and is_name(each[0]) and each[1] in _SIGNS
    ]
    return comparisons if len(comparisons) == len(parts) else []


_SIGNS = frozenset({"<", ">", "<=", ">=", "==", "!="})


def _implies(first: _Comparison, second: _Comparison) -> bool:
    """Return whether the first comparison implies the second: the same, or with a stricter number."""
    if first == second:
        return True
    if first[:2] != second[:2] or not all(each[2].replace(".", "", 1).isdecimal() for each in (first, second)):
        return False
    return (
        float(first[2]) <= float(second[2])
        if first[1][0] == "<"
        else first[1][0] == ">" and float(first[2]) >= float(second[2])
    )


def _build_item_tokens(items: str, name: str) -> tuple[str, ...]:
    return items, "[", name, "]"


def _swap_sides(name: str) -> str:
    """Swap left and right in a name."""
    return _SIDE.sub(lambda found: _OTHER_SIDE.get(found[0], found[0]), name)
