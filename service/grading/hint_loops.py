"""Hints on programs stopped at the limit of simulated or CPU time, with the line and the reason.

The loop's condition and body are searched for the reason. If there is no clear reason, only the line is named.
"""

from __future__ import annotations

import keyword
from collections.abc import Iterator, Sequence

from service.grading.findings import ReportedFault
from service.grading.hint_clues import Clues, Listing, describe_fault_line, find_listing
from service.grading.hint_code import CodeStatements, Statement, is_name, join_tokens
from service.grading.hint_tables import AMOUNTS, CONTINUOUS_MOVES, LIMITED_MOVES, PROPERTIES, READINGS
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
        location, listing = describe_fault_line(fault, clues), find_listing(fault, clues)
        if not location or listing is None:
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
            reported = (clues.find_finding(each, ReportedFault) for each in clues.lost)
            is_reported = any(each is not None and each.fault.verdict is fault.verdict for each in reported)
            if fault.verdict is Verdict.CPU_LIMIT or (fault.verdict is Verdict.TIME_LIMIT and is_reported):
                yield fault


def _explain_limit(fault: Fault, listing: Listing, statement: Statement, clues: Clues) -> str:
    code = listing.code
    amount = describe_large_amount(code, statement, clues.limit)
    if amount:
        return f"{listing.locate(statement.line)}: {amount}"
    passed_amount = _describe_passed_amount(code, listing, statement)
    if passed_amount:
        return passed_amount
    loops = code.list_enclosing_loops(statement)
    for loop in loops:
        explanation = _explain_endless_loop(loop, code, listing, fault)
        if explanation:
            return explanation
    stop_event = "the simulated time was up" if fault.verdict is Verdict.TIME_LIMIT else "it was stopped"
    part_name = "responder" if fault.who == "responder" else "program"
    if loops and clues.is_stationary and _waits_for_motion(loops[0], code):
        return (
            f"{listing.locate(loops[0].line)}: the loop waits until the robot has moved, but no line switches the "
            f"motors on, so {join_tokens(loops[0].condition)} stays true. Write tank_drive.on(20, 20) above line "
            f"{loops[0].line}"
        )
    if loops and loops[0].has_token("pyState") and not clues.answers:
        reason = "no answer came" if clues.sent else "no message was sent: print one that begins with PY:: or IMG_DATA"
        return f"{listing.locate(loops[0].line)}: the loop waits for a message in the queue, but {reason}"
    if loops:
        head = join_tokens(loops[0].tokens)
        return (
            f'{listing.locate(loops[0].line)}: the {part_name} was still in the loop "{head}" when {stop_event}. '
            f"{_suggest_loop_fix(loops[0], code, fault)}"
        )
    return (
        f'{listing.locate(statement.line)}: the {part_name} was still in the line "{join_tokens(statement.tokens)}" '
        f"when {stop_event}. Check what it waits for, and whether that ever happens"
    )


def _waits_for_motion(loop: Statement, code: CodeStatements) -> bool:
    """Return whether a loop's condition reads a sensor or motor, and no statement of the text moves the robot."""
    methods = {call.name.rpartition(".")[2] for each in code.statements for call in each.calls if "." in call.name}
    is_moving = bool(methods & (LIMITED_MOVES | CONTINUOUS_MOVES))
    return loop.keyword == "while" and loop.has_token(*PROPERTIES) and not is_moving


def _suggest_loop_fix(loop: Statement, code: CodeStatements, fault: Fault) -> str:
    if fault.verdict is Verdict.CPU_LIMIT and fault.who != "responder" and not _is_waiting(loop, code):
        return "Nothing in it waits, so the robot cannot move. Add time.sleep(0.1), or read a sensor, in the loop"
    if fault.who == "responder":
        return "Check when it ends, or make the calculation smaller"
    return "Check when its condition becomes false, or end it with break"


def describe_large_amount(code: CodeStatements, statement: Statement, time_limit: float) -> str:
    """Return a hint that a call has a time or an amount in the wrong unit; otherwise empty."""
    for call in statement.calls:
        usual_amount = AMOUNTS.get(call.name.rpartition(".")[2])
        arguments = [each for each in call.arguments if "=" not in each]
        number = code.number(arguments[-1]) if arguments else None
        if usual_amount is None or number is None or abs(number) < min(usual_amount[0], time_limit or usual_amount[0]):
            continue
        maximum, unit, other_unit = usual_amount
        if abs(number) < maximum / 2:
            continue
        if other_unit == "milliseconds":
            fix = f"{number:g} milliseconds are {number / 1000:g} seconds: write {number / 1000:g}"
        else:
            fix = f"For {number:g} degrees of the wheels write on_for_degrees, or {number / 360:g} rotations"
        return f"{call.name} takes {unit}, and {number:g} {unit} are too many. {fix}"
    return ""


def _describe_passed_amount(code: CodeStatements, listing: Listing, statement: Statement) -> str:
    """Return a hint on a call that gives a function a much too large number for an amount; otherwise empty."""
    head = next((each for each in code.list_enclosing(statement) if each.keyword == "def"), None)
    parameters = (
        [token for at, token in enumerate(head.tokens) if at > 2 and head.tokens[at - 1] in "(,"] if head else []
    )
    for call in statement.calls if head is not None else ():
        usual_amount = AMOUNTS.get(call.name.rpartition(".")[2])
        name = call.arguments[-1][0] if call.arguments and len(call.arguments[-1]) == 1 else ""
        if usual_amount is None or head is None or name not in parameters:
            continue
        for caller in code.statements:
            for outer in caller.calls if caller is not head else ():
                place = parameters.index(name)
                argument = outer.arguments[place] if len(outer.arguments) > place else ()
                number = code.number(argument[2:] if argument[1:2] == ("=",) else argument) if argument else None
                if outer.name == head.tokens[1] and number is not None and abs(number) >= usual_amount[0]:
                    return (
                        f"{listing.locate(caller.line)} gives {outer.name} {number:g} for {name}, and {number:g} "
                        f"{usual_amount[1]} are too many. Check the order of the values: "
                        f"{join_tokens(head.tokens)[4:-1]}"
                    )
    return ""


def _explain_endless_loop(loop: Statement, code: CodeStatements, listing: Listing, fault: Fault) -> str:
    """Return why a loop does not end; empty if that is not clear."""
    body = code.list_body(loop)
    location = listing.locate(loop.line)
    if loop.keyword == "for":
        range_call = next((call for call in loop.calls if call.name == "range"), None)
        numbers = [
            number for each in (range_call.arguments if range_call else ()) if (number := code.number(each)) is not None
        ]
        if numbers and max(map(abs, numbers)) >= _MAX_ITERATIONS:
            return f"{location}: this loop has {max(numbers):,.0f} passes, which is too many. Use a smaller number"
        return ""
    head, condition = join_tokens(loop.tokens), loop.condition
    for statement in body:
        effect = describe_discarded_value(statement, code)
        if effect and any(token in condition for token in statement.tokens if is_name(token)):
            consequence = f"so the loop in line {loop.line}, {head[:-1]}, never ends"
            return f"{listing.locate(statement.line)}: {effect}, {consequence}. {suggest_correct_statement(statement)}"
    if condition in (("True",), ("1",), ("not", "False")):
        stale_reading = _describe_stale_reading(loop, body, code)
        if stale_reading:
            return f"{location}: {stale_reading}"
        if any(each.keyword in ("break", "return") for each in body):
            return ""
        return (
            f"{location}: {head[:-1]} repeats for ever{_describe_missing_actions(body, fault)}. "
            f"{_suggest_loop_end(body, fault)}"
        )
    explanation = explain_always_true(condition, code)
    if explanation:
        return f"{location}: {head[:-1]} never ends: {explanation}"
    step = _find_wrong_step(loop, body)
    if step:
        statement, effect, fix = step
        consequence = f"so the loop in line {loop.line}, {head[:-1]}, never ends"
        return f"{listing.locate(statement.line)}: {join_tokens(statement.tokens)} {effect}, {consequence}. {fix}"
    names = {token for place, token in enumerate(condition) if is_name(token) and token not in _KEYWORDS}
    has_reading = any(token in (".", "(") for token in condition)
    assigned_names = {name for each in body for name in each.bound_names}
    calls = {call.name for each in body for call in each.calls}
    if (
        names
        and not has_reading
        and not names & assigned_names
        and not any(each.keyword == "global" for each in code.statements)
    ):
        return f"{location}: {head[:-1]} never ends: {_describe_unchanged_names(sorted(names), loop, code, calls)}"
    equality_indices = [place for place, token in enumerate(condition) if token in ("!=", "==")]
    if (
        equality_indices
        and any(token in PROPERTIES for token in condition)
        and any(each[:1].isdigit() for each in condition)
    ):
        reason = "the value can jump past the number between two readings"
        return f"{location}: {head[:-1]} does not end: {reason}. Compare with < or >"
    return ""


def _find_wrong_step(loop: Statement, body: Sequence[Statement]) -> tuple[Statement, str, str] | None:
    """Return the statement that moves a counter away from its limit, its effect, and the fix; otherwise None."""
    condition = loop.condition
    if len(condition) < 3 or condition[1] not in _DIVERGING_SIGNS or not is_name(condition[0]):
        return None
    name, sign = condition[0], condition[1]
    for statement in body:
        if statement.parent != loop.number:
            continue
        if statement.target == name and len(statement.tokens) == 3 and not is_name(statement.tokens[2]):
            effect = f"gives {name} the same value in each pass"
            return statement, effect, "Move it to the line before the loop, without indentation"
        direction = _find_step_sign(statement, name)
        if direction == _DIVERGING_SIGNS[sign]:
            verb, correct_sign = ("grow", "-") if direction == "+" else ("shrink", "+")
            return statement, f"makes {name} {verb}", f"Write {correct_sign} instead of {direction}"
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
    assigned_names = {name for each in body for name in each.bound_names}
    for statement in code.statements[: loop.number]:
        if (
            statement.target
            and _is_reading(statement)
            and statement.target not in assigned_names
            and any(one.has_token(statement.target) for one in body)
        ):
            reading_code = join_tokens(statement.tokens)
            return (
                f"{statement.target} is read once, in line {statement.line}, and not again. Repeat {reading_code} in "
                "the loop"
            )
    return ""


def _describe_missing_actions(body: Sequence[Statement], fault: Fault) -> str:
    missing_actions = []
    if fault.verdict is Verdict.CPU_LIMIT and fault.who != "responder":
        missing_actions.append("nothing in it waits")
    if not any(_is_reading(each) for each in body) and fault.who != "responder":
        missing_actions.append("it reads no sensor")
    return f", and {' and '.join(missing_actions)}" if missing_actions else ""


def _suggest_loop_end(body: Sequence[Statement], fault: Fault) -> str:
    if fault.who == "responder":
        return "End it with break, or write a condition instead of True"
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
    is_plain = all(is_name(each) or each in "+-*/.==<>" or each[0].isdigit() for each in tokens)
    return f"{join_tokens(tokens)} has no effect" if is_plain and tokens[0] not in _STATEMENTS else ""


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
    sign_index = next((at for at, token in enumerate(condition) if token in ("<", ">", "<=", ">=")), None)
    if sign_index is None or any(token in ("and", "or", "not") for token in condition):
        return ""
    sign, name = condition[sign_index], find_reading(condition[:sign_index], code)
    number = code.number(condition[sign_index + 1 :])
    if not name or number is None:
        return ""
    minimum, maximum, unit = READINGS[name]
    is_always_true = {">=": number <= minimum, ">": number < minimum, "<=": number >= maximum, "<": number > maximum}[
        sign
    ]
    if not is_always_true:
        return ""
    condition_text = join_tokens(condition)
    advice = (
        f"Write {sign[0]} {number:g}"
        if sign in (">=", "<=") and number in (minimum, maximum)
        else "Choose a number within"
    )
    return f"{condition_text} is always true, because {name} {unit}. {advice}"


def find_reading(tokens: Sequence[str], code: CodeStatements) -> str:
    """Return the reading that the token is or that was assigned to the name; otherwise empty."""
    name = tokens[-1] if tokens and tokens[-1] in READINGS else _find_source_token(tokens, code)
    return name if name in READINGS else ""


def _find_source_token(tokens: Sequence[str], code: CodeStatements) -> str:
    """Return the last token of the value assigned to a name; otherwise empty."""
    if len(tokens) != 1:
        return ""
    assignment = next((each for each in code.statements if each.target == tokens[0]), None)
    return assignment.tokens[-1] if assignment is not None else ""


def _describe_unchanged_names(names: Sequence[str], loop: Statement, code: CodeStatements, calls: set[str]) -> str:
    name_list = " and ".join(names[:2])
    verb = "does not change" if len(names) == 1 else "do not change"
    for name in names:
        assignment = next(
            (each for each in code.statements[: loop.number] if each.target == name and _is_reading(each)), None
        )
        if assignment is not None:
            return (
                f"{name} is read once, in line {assignment.line}, and not again. Repeat "
                f"{join_tokens(assignment.tokens)} in the loop"
            )
    return f"{name_list} {verb} in the loop. Assign {names[0]} in the loop"


def _is_reading(statement: Statement) -> bool:
    return any(token in PROPERTIES or token in ("get_clock", "pyState") for token in statement.tokens)


def _is_waiting(loop: Statement, code: CodeStatements) -> bool:
    """Return whether the loop takes simulated time. Reading the state of a motor takes none."""
    return any(token in _WAITS for each in (loop, *code.list_body(loop)) for token in each.tokens)
