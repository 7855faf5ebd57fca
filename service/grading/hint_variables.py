"""Slips with variables that one program's text proves: wrong case, wrong side's sensor, a step too early.

``hint_slips.py`` runs these rules with its own.
"""

from __future__ import annotations

import re

from service.grading.hint_clues import Listing
from service.grading.hint_code import Statement, is_name, join_tokens

_SIDE = re.compile("left|right", re.IGNORECASE)
_OTHER_SIDE = {"left": "right", "right": "left", "Left": "Right", "Right": "Left", "LEFT": "RIGHT", "RIGHT": "LEFT"}


def check_name_case(listing: Listing, statement: Statement) -> str:
    """Return a hint on ``Count = count + 1``: an unread name that differs from another only in case."""
    name, tokens = statement.target, statement.tokens
    meant = next((each for each in tokens[2:] if each != name and each.casefold() == name.casefold()), "")
    statements = listing.code.statements
    if not name or not is_name(meant) or not any(each.target == meant for each in statements):
        return ""
    if any(name in (each.tokens[1:] if each.target == name else each.tokens) for each in statements):
        return ""
    return (
        f"{listing.locate(statement.line)} assigns {name}, so {meant} stays as it is: upper and lower case are "
        "different. "
        f"Write {meant} = {join_tokens(tokens[2:])}"
    )


def check_mixed_sides(listing: Listing, statement: Statement) -> str:
    """Return a hint on a name with right in it that is assigned a value from the left, or the reverse."""
    name, value = statement.target, statement.tokens[2:]
    twin = _swap_sides(name)
    fixed = tuple(_swap_sides(token) if is_name(token) else token for token in value)
    sides = {side.lower() for token in value if is_name(token) for side in _SIDE.findall(token)}
    own = {side.lower() for side in _SIDE.findall(name)}
    if len(own) != 1 or len(sides) != 1 or own == sides:
        return ""
    other = next((each for each in listing.code.statements if each.target == twin and each.tokens[2:] == value), None)
    if other is None:
        return ""
    again = [each.line for each in listing.code.statements if each.target == name and each.tokens[2:] == value]
    more = "" if len(again) < 2 else f" in lines {', '.join(map(str, again[:-1]))} and {again[-1]}"
    return (
        f"{listing.locate(statement.line)} gives {name} the same value as {twin} in line {other.line}: "
        f"{join_tokens(value)}. "
        f"Write {name} = {join_tokens(fixed)}{more}"
    )


def check_early_step(listing: Listing, statement: Statement) -> str:
    """Return a hint on ``tosses[count]`` after ``count = count + 1`` in ``while count < len(tosses)``."""
    code = listing.code
    loop = next((each for each in code.list_enclosing(statement) if each.keyword == "while"), None)
    if loop is None or len(loop.condition) != 6 or loop.condition[1:4] != ("<", "len", "("):
        return ""
    name, items = loop.condition[0], loop.condition[4]
    place = next(
        (
            at
            for at in range(len(statement.tokens) - 3)
            if statement.tokens[at : at + 4] == _build_item_tokens(items, name)
        ),
        None,
    )
    from_zero = [each for each in code.statements[: loop.number] if each.target == name][-1:]
    steps = [each for each in code.list_body(loop) if name in each.bound_names]
    if place is None or not from_zero or from_zero[0].tokens[2:] != ("0",) or len(steps) != 1:
        return ""
    step = steps[0]
    grows = step.tokens[1:] in (("+=", "1"), ("=", name, "+", "1"))
    if not grows or step.parent != loop.number or step.number >= statement.number:
        return ""
    return (
        f"{listing.locate(statement.line)}: line {step.line} has already added 1 to {name}, so {items}[{name}] "
        "skips the "
        f"first item and goes past the last. Write {items}[{name} - 1]"
    )


def check_removal_in_loop(listing: Listing, statement: Statement) -> str:
    """Return a hint on ``days.remove(day)`` in ``for day in days``, which skips the item after each removal."""
    tokens, code = statement.tokens, listing.code
    loop = next((each for each in code.list_enclosing(statement) if each.keyword == "for"), None)
    if loop is None or len(loop.tokens) != 5 or tokens[1:4] != (".", "remove", "(") or tokens[0] != loop.tokens[3]:
        return ""
    after = code.statements[statement.number + 1 : statement.number + 2]
    if after and after[0].keyword in ("break", "return") and after[0].parent == statement.parent:
        return ""
    name, items = loop.tokens[1], loop.tokens[3]
    return (
        f"{listing.locate(statement.line)} removes from {items}, the list that the loop in line {loop.line} goes "
        "through, "
        f"so the loop skips the item after it. Append each {name} that is kept to a new list"
    )


def check_unreachable_if(listing: Listing, statement: Statement) -> str:
    """Return a hint on ``if a < 5 and b < 5`` after an ``if a < 9`` that returns: the second is never true."""
    code, asked = listing.code, _parse_conjuncts(statement)
    in_chain = statement.keyword == "elif"
    for each in reversed(code.statements[: statement.number]) if asked else ():
        if each.indent < statement.indent or (each.parent == statement.parent and each.keyword not in ("if", "elif")):
            return ""
        if each.parent != statement.parent:
            if any(one[0] in each.bound_names for one in asked) and each.keyword not in _EXIT_KEYWORDS:
                return ""
            continue
        body, earlier = code.list_body(each), _parse_conjuncts(each)
        leaves = bool(body) and body[-1].parent == each.number and body[-1].keyword in _EXIT_KEYWORDS
        if (in_chain or leaves) and earlier and all(any(_implies(one, other) for one in asked) for other in earlier):
            return (
                f"{listing.locate(statement.line)} is never true: wherever {join_tokens(statement.condition)}, "
                f"line {each.line} "
                f"has already found that {join_tokens(each.condition)}. Move this condition above line {each.line}"
            )
        in_chain = in_chain and each.keyword == "elif"
    return ""


_EXIT_KEYWORDS = frozenset({"return", "break", "continue", "raise"})
_Comparison = tuple[str, str, str]


def _parse_conjuncts(statement: Statement) -> list[_Comparison]:
    """Return the name comparisons that ``and`` joins in a condition. Empty if it contains anything else."""
    if statement.keyword not in ("if", "elif"):
        return []
    parts: list[tuple[str, ...]] = [()]
    for token in statement.condition:
        parts = [*parts, ()] if token == "and" else [*parts[:-1], (*parts[-1], token)]
    found = [(each[0], each[1], each[2]) for each in parts if len(each) == 3 and is_name(each[0]) and each[1] in _SIGNS]
    return found if len(found) == len(parts) else []


_SIGNS = frozenset({"<", ">", "<=", ">=", "==", "!="})


def _implies(one: _Comparison, other: _Comparison) -> bool:
    """Return whether the first comparison implies the second: the same, or with a stricter number."""
    if one == other:
        return True
    if one[:2] != other[:2] or not all(each[2].replace(".", "", 1).isdecimal() for each in (one, other)):
        return False
    return (
        float(one[2]) <= float(other[2]) if one[1][0] == "<" else one[1][0] == ">" and float(one[2]) >= float(other[2])
    )


def _build_item_tokens(items: str, name: str) -> tuple[str, ...]:
    return items, "[", name, "]"


def _swap_sides(name: str) -> str:
    """Swap left and right in a name."""
    return _SIDE.sub(lambda found: _OTHER_SIDE.get(found[0], found[0]), name)
