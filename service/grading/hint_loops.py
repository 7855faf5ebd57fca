"""Hints on programs stopped at the limit of simulated or CPU time, with the line and the reason.

The loop's condition and body are searched for the reason. If there is no clear reason, only the line is named.
"""

from __future__ import annotations

import keyword
from collections.abc import Iterator, Sequence

from service.grading.hint_clues import Clues, Listing, describe_fault_line, find_listing
from service.grading.hint_code import CodeStatements, Statement, is_name, join_tokens
from service.grading.hint_tables import AMOUNTS, LIMITED_MOVES, PROPERTIES, READINGS
from sim.recording import Fault, Verdict
from sim.recording_values import collect_faults

_LIMITS = (Verdict.TIME_LIMIT, Verdict.CPU_LIMIT)
_FREE_PROPERTIES = frozenset({"position", "speed", "state", "is_running"})
_WAITS = (
    frozenset({"sleep", "wait_until_not_moving", "wait_until", "wait", "wait_while"})
    | LIMITED_MOVES
    | (PROPERTIES - _FREE_PROPERTIES)
)
_KEYWORDS = frozenset({"and", "or", "not", "in", "is", "True", "False", "None", "len"})
_MAX_ITERATIONS = 100_000


def hint_about_limits(clues: Clues) -> Iterator[str]:
    """Yield hints with the line where a program was stopped and why the loop around it does not end."""
    for fault in dict.fromkeys(_collect_limit_faults(clues)):
        where, listing = describe_fault_line(fault, clues), find_listing(fault, clues)
        if not where or listing is None:
            continue
        statement = listing.code.find_statement(fault.line)
        if statement is None:
            continue
        yield _explain_limit(fault, listing, statement, clues)
        return


def _collect_limit_faults(clues: Clues) -> Iterator[Fault]:
    """Yield the faults that ended trials at a limit. Time limits count only if a criterion reports them."""
    for recording in clues.recordings:
        for fault in collect_faults(recording)[:1]:
            told = any(fault.message in each.message for each in clues.results)
            if fault.verdict is Verdict.CPU_LIMIT or (fault.verdict is Verdict.TIME_LIMIT and told):
                yield fault


def _explain_limit(fault: Fault, listing: Listing, statement: Statement, clues: Clues) -> str:
    code = listing.code
    amount = describe_large_amount(code, statement, clues.limit)
    if amount:
        return f"{listing.locate(statement.line)}: {amount}"
    loops = code.list_enclosing_loops(statement)
    for loop in loops:
        why = _explain_endless_loop(loop, code, listing, fault)
        if why:
            return why
    up = "the simulated time was up" if fault.verdict is Verdict.TIME_LIMIT else "it was stopped"
    who = "responder" if fault.who == "responder" else "program"
    if loops:
        head = join_tokens(loops[0].tokens)
        return (
            f'{listing.locate(loops[0].line)}: the {who} was still in the loop "{head}" when {up}. '
            f"{_suggest_loop_fix(loops[0], code, fault)}"
        )
    return (
        f'{listing.locate(statement.line)}: the {who} was still in the line "{join_tokens(statement.tokens)}" '
        f"when {up}. "
        "Check what it waits for, and whether that ever happens"
    )


def _suggest_loop_fix(loop: Statement, code: CodeStatements, fault: Fault) -> str:
    if fault.verdict is Verdict.CPU_LIMIT and fault.who != "responder" and not _is_waiting(loop, code):
        return "Nothing in it waits, so the robot cannot move. Add time.sleep(0.1), or read a sensor, in the loop"
    if fault.who == "responder":
        return "Check when it ends, or make the calculation smaller"
    return "Check when its condition becomes false, or end it with break"


def describe_large_amount(code: CodeStatements, statement: Statement, least: float) -> str:
    """Return a hint that a call has a time or an amount in the wrong unit; otherwise empty."""
    for call in statement.calls:
        known = AMOUNTS.get(call.name.rpartition(".")[2])
        plain = [each for each in call.arguments if "=" not in each]
        number = code.number(plain[-1]) if plain else None
        if known is None or number is None or abs(number) < min(known[0], least or known[0]):
            continue
        most, unit, other = known
        if abs(number) < most / 2:
            continue
        if other == "milliseconds":
            fix = f"{number:g} milliseconds are {number / 1000:g} seconds: write {number / 1000:g}"
        else:
            fix = f"For {number:g} degrees of the wheels write on_for_degrees, or {number / 360:g} rotations"
        return f"{call.name} takes {unit}, and {number:g} {unit} are too many. {fix}"
    return ""


def _explain_endless_loop(loop: Statement, code: CodeStatements, listing: Listing, fault: Fault) -> str:
    """Return why a loop does not end; empty if that is not clear."""
    body = code.list_body(loop)
    where = listing.locate(loop.line)
    if loop.keyword == "for":
        turns = next((call for call in loop.calls if call.name == "range"), None)
        numbers = [number for each in (turns.arguments if turns else ()) if (number := code.number(each)) is not None]
        if numbers and max(map(abs, numbers)) >= _MAX_ITERATIONS:
            return f"{where}: this loop has {max(numbers):,.0f} passes, which is too many. Use a smaller number"
        return ""
    head, condition = join_tokens(loop.tokens), loop.condition
    for each in body:
        effect = describe_discarded_value(each, code)
        if effect and any(token in condition for token in each.tokens if is_name(token)):
            never = f"so the loop in line {loop.line}, {head[:-1]}, never ends"
            return f"{listing.locate(each.line)}: {effect}, {never}. {suggest_correct_statement(each)}"
    if condition in (("True",), ("1",), ("not", "False")):
        once = _describe_stale_reading(loop, body, code)
        if once:
            return f"{where}: {once}"
        if any(each.keyword in ("break", "return") for each in body):
            return ""
        return (
            f"{where}: {head[:-1]} repeats for ever{_describe_missing_actions(body, fault)}. "
            f"{_suggest_loop_end(body, fault)}"
        )
    always = explain_always_true(condition, code)
    if always:
        return f"{where}: {head[:-1]} never ends: {always}"
    step = _find_wrong_step(loop, body)
    if step:
        each, effect, fix = step
        never = f"so the loop in line {loop.line}, {head[:-1]}, never ends"
        return f"{listing.locate(each.line)}: {join_tokens(each.tokens)} {effect}, {never}. {fix}"
    names = {token for place, token in enumerate(condition) if is_name(token) and token not in _KEYWORDS}
    reads = any(token in (".", "(") for token in condition)
    changed = {name for each in body for name in each.bound_names}
    calls = {call.name for each in body for call in each.calls}
    if names and not reads and not names & changed and not any(each.keyword == "global" for each in code.statements):
        return f"{where}: {head[:-1]} never ends: {_describe_unchanged_names(sorted(names), loop, code, calls)}"
    exact = [place for place, token in enumerate(condition) if token in ("!=", "==")]
    if exact and any(token in PROPERTIES for token in condition) and any(each[:1].isdigit() for each in condition):
        past = "the value can jump past the number between two readings"
        return f"{where}: {head[:-1]} does not end: {past}. Compare with < or >"
    return ""


def _find_wrong_step(loop: Statement, body: Sequence[Statement]) -> tuple[Statement, str, str] | None:
    """Return the statement that moves a counter away from its limit, its effect, and the fix; otherwise None."""
    condition = loop.condition
    if len(condition) < 3 or condition[1] not in _DIVERGING_SIGNS or not is_name(condition[0]):
        return None
    name, sign = condition[0], condition[1]
    for each in body:
        if each.parent != loop.number:
            continue
        if each.target == name and len(each.tokens) == 3 and not is_name(each.tokens[2]):
            again = f"gives {name} the same value in each pass"
            return each, again, "Move it to the line before the loop, without indentation"
        direction = _find_step_sign(each, name)
        if direction == _DIVERGING_SIGNS[sign]:
            away, towards = ("grow", "-") if direction == "+" else ("shrink", "+")
            return each, f"makes {name} {away}", f"Write {towards} in place of {direction}"
    return None


def _find_step_sign(statement: Statement, name: str) -> str:
    """Return ``+`` or ``-`` if the statement adds to the name or subtracts from it; otherwise empty."""
    tokens = statement.tokens
    if tokens[0] == name and len(tokens) == 3 and tokens[1] in ("+=", "-="):
        return tokens[1][0]
    if len(tokens) == 5 and tokens[:3] == (name, "=", name) and tokens[3] in ("+", "-"):
        return tokens[3]
    return ""


#: The sign that leads away from the end of a loop with this comparison.
_DIVERGING_SIGNS = {">": "+", ">=": "+", "<": "-", "<=": "-"}


def _describe_stale_reading(loop: Statement, body: Sequence[Statement], code: CodeStatements) -> str:
    """Return a hint on a reading that the loop uses but that is read only once, before it."""
    if any(_is_reading(each) for each in body):
        return ""
    changed = {name for each in body for name in each.bound_names}
    for each in code.statements[: loop.number]:
        if (
            each.target
            and _is_reading(each)
            and each.target not in changed
            and any(one.has_token(each.target) for one in body)
        ):
            again = join_tokens(each.tokens)
            return f"{each.target} is read once, in line {each.line}, and not again. Repeat {again} in the loop"
    return ""


def _describe_missing_actions(body: Sequence[Statement], fault: Fault) -> str:
    missing = []
    if fault.verdict is Verdict.CPU_LIMIT and fault.who != "responder":
        missing.append("nothing in it waits")
    if not any(_is_reading(each) for each in body) and fault.who != "responder":
        missing.append("it reads no sensor")
    return f", and {' and '.join(missing)}" if missing else ""


def _suggest_loop_end(body: Sequence[Statement], fault: Fault) -> str:
    if fault.who == "responder":
        return "End it with break, or write a condition in place of True"
    if fault.verdict is Verdict.CPU_LIMIT:
        return "Read a sensor in its condition, or add time.sleep(0.1) and end it with break"
    return "End it with break, write a condition that reads a sensor, or remove the loop"


def describe_discarded_value(statement: Statement, code: CodeStatements) -> str:
    """Return a hint that a statement computes a value and discards it; empty if it has an effect."""
    tokens = statement.tokens
    if _has_reversed_operator(statement, code):
        return f"{tokens[0]} ={tokens[2]} {tokens[3]} sets {tokens[0]} to {tokens[2]}{tokens[3]}"
    operators = [token for token in tokens if token in ("+", "-", "*", "/", "==", "<", ">")]
    if not is_name(tokens[0]) or not operators or any(each.endswith("=") and each != "==" for each in tokens):
        return ""
    plain = all(is_name(each) or each in "+-*/.==<>" or each[0].isdigit() for each in tokens)
    return f"{join_tokens(tokens)} has no effect" if plain and tokens[0] not in _STATEMENTS else ""


def _has_reversed_operator(statement: Statement, code: CodeStatements) -> bool:
    """Return whether this is ``count =- 1``, spaced so, in a loop, for a variable assigned earlier."""
    tokens, columns, name = statement.tokens, statement.columns, statement.target
    if len(tokens) != 4 or not name or name.isupper() or tokens[2] not in ("+", "-"):
        return False
    is_written_so = columns[2] == columns[1] + 1 and columns[3] > columns[2] + 1
    has_value = any(each.target == name for each in code.statements[: statement.number])
    return is_written_so and has_value and bool(code.list_enclosing_loops(statement))


_STATEMENTS = frozenset(keyword.kwlist)


def suggest_correct_statement(statement: Statement) -> str:
    """Return the correct form of a statement without effect."""
    tokens = statement.tokens
    if tokens[1] == "=":
        return f"Write {tokens[0]} {tokens[2]}= {tokens[3]}"
    if tokens[1] == "==":
        return f"Write one = for an assignment: {tokens[0]} = {join_tokens(tokens[2:])}"
    return f"Write {tokens[0]} = {join_tokens(tokens)}"


def explain_always_true(condition: Sequence[str], code: CodeStatements) -> str:
    """Return why a comparison of a reading with a number is always true; empty if it is not."""
    place = next((at for at, token in enumerate(condition) if token in ("<", ">", "<=", ">=")), None)
    if place is None or any(token in ("and", "or", "not") for token in condition):
        return ""
    sign, name = condition[place], find_reading(condition[:place], code)
    number = code.number(condition[place + 1 :])
    if not name or number is None:
        return ""
    least, most, unit = READINGS[name]
    holds = {">=": number <= least, ">": number < least, "<=": number >= most, "<": number > most}[sign]
    if not holds:
        return ""
    what = join_tokens(condition)
    better = (
        f"Write {sign[0]} {number:g}" if sign in (">=", "<=") and number in (least, most) else "Choose a number within"
    )
    return f"{what} is always true, because {name} {unit}. {better}"


def find_reading(tokens: Sequence[str], code: CodeStatements) -> str:
    """Return the reading that the token is or that was assigned to the name; otherwise empty."""
    name = tokens[-1] if tokens and tokens[-1] in READINGS else _find_source_token(tokens, code)
    return name if name in READINGS else ""


def _find_source_token(tokens: Sequence[str], code: CodeStatements) -> str:
    """Return the last token of the value assigned to a name; otherwise empty."""
    if len(tokens) != 1:
        return ""
    given = next((each for each in code.statements if each.target == tokens[0]), None)
    return given.tokens[-1] if given is not None else ""


def _describe_unchanged_names(names: Sequence[str], loop: Statement, code: CodeStatements, calls: set[str]) -> str:
    listed = " and ".join(names[:2])
    change = "does not change" if len(names) == 1 else "do not change"
    for name in names:
        given = next(
            (each for each in code.statements[: loop.number] if each.target == name and _is_reading(each)), None
        )
        if given is not None:
            return (
                f"{name} is read once, in line {given.line}, and not again. Repeat {join_tokens(given.tokens)} in the "
                "loop"
            )
    return f"{listed} {change} in the loop. Assign {names[0]} in the loop"


def _is_reading(statement: Statement) -> bool:
    return any(token in PROPERTIES or token in ("get_clock", "pyState") for token in statement.tokens)


def _is_waiting(loop: Statement, code: CodeStatements) -> bool:
    """Return whether the loop takes simulated time. Reading the state of a motor takes none."""
    return any(token in _WAITS for each in (loop, *code.list_body(loop)) for token in each.tokens)
