"""Slips with values that loops and functions lose, keep or reset, as one text proves them.

``hint_slips.py`` runs these rules with its own.
"""

from __future__ import annotations

import re
from collections.abc import Sequence

from service.grading.hint_clues import Listing
from service.grading.hint_code import LOOPS, CodeStatements, Statement, is_name, join_tokens
from service.language import translatable
from sim.sentences import Sentence

_LARGEST = re.compile(r"(?:.*_)?(?:longest|max|maximum|biggest|largest|highest|best|most|brightest)(?:_.*)?\Z", re.I)
_SMALLEST = re.compile(r"(?:.*_)?(?:shortest|min|minimum|smallest|lowest|least|darkest|nearest)(?:_.*)?\Z", re.I)
_EMPTY_VALUES = frozenset({"None", '""', "''"})
_EQUALITY = frozenset({"==", "!="})
#: Tokens of functions that do more than compute a value.
_EFFECTS = frozenset({"print", "say", "speak", "open", "global", "nonlocal", "append", "write", "sleep", "yield"})
_ACTIONS = re.compile(r"tank_|motor|on_for|steer")


def check_overwritten_extreme(listing: Listing, statement: Statement) -> str:
    """Return a hint on ``longest = run`` in each pass of a loop, where the larger value should be kept."""
    code, name, value = listing.code, statement.target, statement.tokens[2:]
    function = "max" if _LARGEST.match(name) else "min" if _SMALLEST.match(name) else ""
    parent = _find_parent(code, statement)
    if not function or len(value) != 1 or not is_name(value[0]) or parent is None or parent.keyword not in LOOPS:
        return ""
    others = [each for each in code.list_body(parent) if each is not statement and each.has_token(name)]
    is_started = any(each.target == name for each in code.statements[: parent.number])
    is_used = any(each.has_token(name) for each in code.list_following(parent)[len(code.list_body(parent)) :])
    if others or not is_started or not is_used:
        return ""
    return Sentence(
        "%(place)s gives %(name)s a new value in each pass, so the last one counts. Write %(name)s = "
        "%(function)s(%(name)s, %(value)s)",
        place=listing.locate(statement.line),
        name=name,
        function=function,
        value=value[0],
    )


def check_stale_comparison(listing: Listing, statement: Statement) -> str:
    """Return a hint on ``toss == before`` in a loop where no line gives ``before`` another value than None."""
    code, tokens = listing.code, statement.tokens
    loop = next((each for each in code.list_enclosing(statement) if each.keyword in LOOPS), None)
    if loop is None or loop.keyword != "for" or loop.tokens[2:3] != ("in",):
        return ""
    for left, sign, right in zip(tokens, tokens[1:], tokens[2:], strict=False):
        name = {(loop.tokens[1], right): right, (left, loop.tokens[1]): left}.get((left, right), "")
        if sign not in _EQUALITY or not is_name(name) or name == loop.tokens[1]:
            continue
        bindings = [each for each in _list_scope(code, statement) if name in each.bound_names]
        if len(bindings) != 1 or bindings[0].number > loop.number or len(bindings[0].tokens) != 3:
            continue
        if bindings[0].target == name and bindings[0].tokens[2] in _EMPTY_VALUES:
            return Sentence(
                "%(place)s compares %(value)s with %(name)s, which is always %(start)s: the loop does not "
                "change it. End the loop with %(name)s = %(value)s",
                place=listing.locate(statement.line),
                value=loop.tokens[1],
                name=name,
                start=bindings[0].tokens[2],
            )
    return ""


def check_reset_before_step(listing: Listing, statement: Statement) -> str:
    """Return a hint on ``count = 0`` just above ``count += 1``, which makes it always 1."""
    code, name = listing.code, statement.target
    following = next(iter(code.list_following(statement)), None)
    heads = [each for each in code.list_enclosing(statement) if each.keyword in (*LOOPS, "def")]
    is_start = len(statement.tokens) == 3 and code.number(statement.tokens[2:]) is not None
    if not name or not is_start or not heads or following is None or following.parent != statement.parent:
        return ""
    if not (following.tokens[:2] == (name, "+=") or following.tokens[:4] == (name, "=", name, "+")):
        return ""
    if heads[0].keyword == "def":
        is_shared = any(each.target == name and each.parent < 0 for each in code.statements)
        if not is_shared:
            return ""
        template = translatable(
            "%(place)s sets %(name)s to %(value)s in each call, so line %(line)s does not count on. Write global "
            "%(name)s in its place"
        )
    else:
        template = translatable(
            "%(place)s sets %(name)s to %(value)s in each pass, so line %(line)s does not count on. Move it "
            "above the loop in line %(loop)s"
        )
    return Sentence(
        template,
        place=listing.locate(statement.line),
        name=name,
        value=statement.tokens[2],
        line=following.line,
        loop=heads[0].line,
    )


def check_kept_list(listing: Listing, statement: Statement) -> str:
    """Return a hint on a list that is made once, and that a function fills and returns in each call."""
    code, tokens = listing.code, statement.tokens
    if statement.keyword != "def" or len(tokens) < 2:
        return ""
    body = code.list_body(statement)
    returned_names = {each.tokens[1] for each in body if each.keyword == "return" and len(each.tokens) == 2}
    filled_names = {
        each.tokens[0] for each in body if len(each.tokens) > 3 and each.tokens[1:3] in ((".", "append"), (".", "add"))
    }
    bound_names = {name for each in body for name in each.bound_names}
    for name in sorted((returned_names & filled_names) - bound_names):
        default = tokens.index(name) if name in tokens[2:] else None
        if default is not None and tokens[default + 1 : default + 4] != ("=", "[", "]"):
            continue
        shared = next(
            (each for each in code.statements if each.parent < 0 and each.tokens == (name, "=", "[", "]")), None
        )
        if default is not None:
            return Sentence(
                "%(place)s makes the list %(name)s only once, so it keeps earlier values. Write %(name)s = "
                "[] as the first line of %(function)s",
                place=listing.locate(statement.line),
                name=name,
                function=tokens[1],
            )
        if shared is not None:
            return Sentence(
                "%(place)s makes the list %(name)s only once, so it keeps the values of earlier calls. Move this line "
                "into %(function)s, above its loop",
                place=listing.locate(shared.line),
                name=name,
                function=tokens[1],
            )
    return ""


def check_discarded_result(listing: Listing, statement: Statement) -> str:
    """Return a hint on ``answer_to(number)`` alone, if that function only computes a value that a loop waits for."""
    code, calls = listing.code, statement.calls
    if not calls or statement.tokens[1:2] != ("(",) or statement.tokens[0] != calls[0].name:
        return ""
    name = calls[0].name
    head = next((each for each in code.list_functions() if each.tokens[1] == name), None)
    body = () if head is None else code.list_body(head)
    is_value = any(each.keyword == "return" and each.tokens[1:] not in ((), ("None",)) for each in body)
    if not is_value or any(_has_effect(each) for each in body) or statement.tokens[-1] != ")":
        return ""
    waiting_names = _list_waiting_names(code, statement)
    # Without a loop that waits for it, the call can be right, for example to show its result below a notebook's cell.
    if len(waiting_names) != 1:
        return ""
    return Sentence(
        "%(place)s calls %(function)s, and does not keep what it returns, so %(name)s does not change. Write "
        "%(name)s = %(call)s",
        place=listing.locate(statement.line),
        function=name,
        name=waiting_names[0],
        call=join_tokens(statement.tokens),
    )


def check_return_in_loop(listing: Listing, statement: Statement) -> str:
    """Return a hint on ``return None`` directly in a ``for`` loop, below an ``if`` that returns what is sought."""
    code, loop = listing.code, _find_parent(listing.code, statement)
    if statement.keyword != "return" or loop is None or loop.keyword != "for":
        return ""
    body = code.list_body(loop)
    has_search = any(each.keyword == "return" and each.parent != loop.number for each in body)
    if not has_search or any(each.keyword in ("continue", "break", "else", "yield") for each in body):
        return ""
    return Sentence(
        "%(place)s: %(code)s is in the loop of line %(line)s, so the loop ends in its first pass. Move %(code)s below "
        "the loop: indent it less",
        place=listing.locate(statement.line),
        code=join_tokens(statement.tokens),
        line=loop.line,
    )


def check_divided_parity(listing: Listing, statement: Statement) -> str:
    """Return a hint on ``number / 2 == 0``, which asks for 0 and not for an even number."""
    tokens = statement.tokens
    for index in range(1, len(tokens) - 3):
        operator, divisor, sign, rest = tokens[index : index + 4]
        is_division = operator in ("/", "//") and divisor.isdecimal() and int(divisor) > 1
        if is_division and sign in _EQUALITY and rest == "0" and is_name(tokens[index - 1]):
            return Sentence(
                "%(place)s: %(code)s compares the quotient with 0. To ask whether %(name)s can be divided by "
                "%(divisor)s, write %(name)s %% %(divisor)s %(sign)s 0",
                place=listing.locate(statement.line),
                code=join_tokens(tokens[index - 1 : index + 4]),
                name=tokens[index - 1],
                divisor=divisor,
                sign=sign,
            )
    return ""


def check_other_return(listing: Listing, statement: Statement) -> str:
    """Return a hint on a function that collects values under a name, and returns another name."""
    code, tokens = listing.code, statement.tokens
    head = next((each for each in code.list_enclosing(statement) if each.keyword == "def"), None)
    if statement.keyword != "return" or len(tokens) != 2 or not is_name(tokens[1]) or head is None:
        return ""
    body = code.list_body(head)
    for start in body:
        name = start.target
        if start.tokens[2:] not in (("[", "]"), ("0",), ('""',), ("''",)) or not name or name == tokens[1]:
            continue
        steps = [each for each in body if each is not start and each.has_token(name)]
        is_returned_value_given = tokens[1] in head.tokens or any(
            each.keyword == "for" and tokens[1] in each.bound_names for each in body
        )
        if steps and all(_is_step(each, name) for each in steps) and is_returned_value_given:
            return Sentence(
                "%(place)s returns %(other)s, and no line uses %(name)s, which line %(line)s changes. Write return "
                "%(name)s",
                place=listing.locate(statement.line),
                other=tokens[1],
                name=name,
                line=steps[0].line,
            )
    return ""


def _is_step(statement: Statement, name: str) -> bool:
    """Return whether a statement only adds to a name."""
    tokens = statement.tokens
    if tokens.count(name) == 1:
        return (tokens[0] == name and tokens[1:3] in ((".", "append"), (".", "add"))) or tokens[:2] == (name, "+=")
    return tokens.count(name) == 2 and tokens[:4] == (name, "=", name, "+")


def _list_waiting_names(code: CodeStatements, statement: Statement) -> list[str]:
    """Return the names in the condition of the enclosing loop that no line in it changes; outside it, none."""
    loop = next((each for each in code.list_enclosing(statement) if each.keyword in LOOPS), None)
    if loop is None or loop.keyword != "while":
        return []
    changed_names = {name for each in code.list_body(loop) for name in each.bound_names}
    assigned_names = {each.target for each in code.statements[: loop.number]}
    return [each for each in dict.fromkeys(loop.condition) if each in assigned_names - changed_names and is_name(each)]


def _has_effect(statement: Statement) -> bool:
    tokens = statement.tokens
    is_item_assigned = "=" in tokens and tokens[1:2] in (("[",), (".",))
    return statement.has_token(*_EFFECTS) or is_item_assigned or any(_ACTIONS.match(each) for each in tokens)


def _find_parent(code: CodeStatements, statement: Statement) -> Statement | None:
    return code.statements[statement.parent] if statement.parent >= 0 else None


def _list_scope(code: CodeStatements, statement: Statement) -> Sequence[Statement]:
    """Return the statements of the function around a statement; outside functions, all."""
    head = next((each for each in code.list_enclosing(statement) if each.keyword == "def"), None)
    return code.statements if head is None else code.list_body(head)


UPDATE_CHECKS = (
    check_overwritten_extreme,
    check_stale_comparison,
    check_reset_before_step,
    check_kept_list,
    check_discarded_result,
    check_return_in_loop,
    check_divided_parity,
    check_other_return,
)
