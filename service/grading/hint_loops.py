"""Hints on programs stopped at the limit of simulated or CPU time, with the line and the reason.

The loop's condition and body are searched for the reason. If there is no clear reason, only the line is named.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from service.grading.findings import ReportedFault
from service.grading.hint_amounts import describe_large_amount, describe_passed_amount
from service.grading.hint_clues import Clues, Listing, describe_fault_line, find_listing
from service.grading.hint_code import CodeStatements, Statement, is_name, join_tokens
from service.grading.hint_structure import describe_discarded_value, has_motor_call, suggest_correct_statement
from service.grading.hint_tables import CONTINUOUS_MOVES, LIMITED_MOVES, PROPERTIES, READINGS
from service.grading.judging.message_parts import add_place
from service.language import translatable
from sim.recording import Fault, Verdict
from sim.recording_values import collect_faults
from sim.sentences import Sentence

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
        return add_place(listing.locate(statement.line), amount)
    passed_amount = describe_passed_amount(code, listing, statement)
    if passed_amount:
        return passed_amount
    loops = code.list_enclosing_loops(statement)
    for loop in loops:
        explanation = _explain_endless_loop(loop, code, listing, fault)
        if explanation:
            return explanation
    if loops and clues.is_stationary and _waits_for_motion(loops[0], code):
        return Sentence(
            "%(place)s: the loop waits until the robot has moved, but no line switches the motors on, so "
            "%(condition)s stays true. Write tank_drive.on(20, 20) above line %(line)s",
            place=listing.locate(loops[0].line),
            condition=join_tokens(loops[0].condition),
            line=loops[0].line,
        )
    late_move = _find_late_move(loops[0], code) if loops and clues.is_stationary else None
    if late_move is not None:
        return Sentence(
            "%(place)s: the loop waits for another reading, but the robot stands still. Move line %(line)s, which "
            "switches the motors on, above line %(loop)s",
            place=listing.locate(loops[0].line),
            line=late_move.line,
            loop=loops[0].line,
        )
    if loops and loops[0].has_token("pyState") and not clues.answers:
        template = (
            translatable("%(place)s: the loop waits for a message in the queue, but no answer came")
            if clues.sent
            else translatable(
                "%(place)s: the loop waits for a message in the queue, but no message was sent: print one that begins "
                "with PY:: or IMG_DATA"
            )
        )
        return Sentence(template, place=listing.locate(loops[0].line))
    part = Sentence("the responder") if fault.who == "responder" else Sentence("the program")
    is_time_up = fault.verdict is Verdict.TIME_LIMIT
    stop_event = Sentence("the simulated time was up") if is_time_up else Sentence("it was stopped")
    if loops:
        return Sentence(
            '%(place)s: %(part)s was still in the loop "%(code)s" when %(event)s. %(advice)s',
            place=listing.locate(loops[0].line),
            part=part,
            code=join_tokens(loops[0].tokens),
            event=stop_event,
            advice=_suggest_loop_fix(loops[0], code, fault),
        )
    return Sentence(
        '%(place)s: %(part)s was still in the line "%(code)s" when %(event)s. Check what it waits for, and whether '
        "that ever happens",
        place=listing.locate(statement.line),
        part=part,
        code=join_tokens(statement.tokens),
        event=stop_event,
    )


def _waits_for_motion(loop: Statement, code: CodeStatements) -> bool:
    """Return whether a loop's condition reads a sensor or motor, and no statement of the text moves the robot."""
    methods = {call.name.rpartition(".")[2] for each in code.statements for call in each.calls if "." in call.name}
    is_moving = bool(methods & (LIMITED_MOVES | CONTINUOUS_MOVES))
    return loop.keyword == "while" and loop.has_token(*PROPERTIES) and not is_moving


def _find_late_move(loop: Statement, code: CodeStatements) -> Statement | None:
    """Return the line that switches the motors on below a loop that reads a sensor, if no line above does."""
    body = code.list_body(loop)
    is_reading = any(each.has_token(*PROPERTIES) for each in (loop, *body))
    moves = [each for each in code.statements if has_motor_call(each, LIMITED_MOVES | CONTINUOUS_MOVES)]
    is_below = bool(moves) and moves[0].number > loop.number + len(body)
    is_alone = loop.keyword == "while" and is_reading and is_below and moves[0].indent == loop.indent
    return moves[0] if is_alone and has_motor_call(moves[0], CONTINUOUS_MOVES) else None


def _suggest_loop_fix(loop: Statement, code: CodeStatements, fault: Fault) -> str:
    if fault.verdict is Verdict.CPU_LIMIT and fault.who != "responder" and not _is_waiting(loop, code):
        return Sentence(
            "Nothing in it waits, so the robot cannot move. Add time.sleep(0.1), or read a sensor, in the loop"
        )
    if fault.who == "responder":
        return Sentence("Check when it ends, or make the calculation smaller")
    return Sentence("Check when its condition becomes false, or end it with break")


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
            return Sentence(
                "%(place)s: this loop has %(count)s passes, which is too many. Use a smaller number",
                place=location,
                count=f"{max(numbers):,.0f}",
            )
        return ""
    head, condition = join_tokens(loop.tokens)[:-1], loop.condition
    for statement in body:
        effect = describe_discarded_value(statement, code)
        if effect and any(token in condition for token in statement.tokens if is_name(token)):
            return _describe_effect(effect, statement, loop, listing, suggest_correct_statement(statement))
    if condition in (("True",), ("1",), ("not", "False")):
        stale_reading = _describe_stale_reading(loop, body, code)
        if stale_reading:
            return add_place(location, stale_reading)
        if any(each.keyword in ("break", "return") for each in body):
            return ""
        problem, advice = _describe_repetition(head, body, fault), _suggest_loop_end(body, fault)
        return Sentence("%(place)s: %(problem)s. %(advice)s", place=location, problem=problem, advice=advice)
    explanation = explain_always_true(condition, code)
    if explanation:
        return Sentence("%(place)s: %(code)s never ends: %(reason)s", place=location, code=head, reason=explanation)
    step = _find_wrong_step(loop, body)
    if step:
        statement, effect, fix = step
        return _describe_effect(effect, statement, loop, listing, fix)
    names = {token for place, token in enumerate(condition) if is_name(token) and token not in _KEYWORDS}
    openings = [place for place, token in enumerate(condition) if token == "("]
    is_called = any(place and condition[place - 1] in names for place in openings)
    has_reading = "." in condition or is_called
    assigned_names = {name for each in body for name in each.bound_names}
    calls = {call.name for each in body for call in each.calls}
    if (
        names
        and not has_reading
        and not names & assigned_names
        and not any(each.keyword == "global" for each in code.statements)
    ):
        explanation = _describe_unchanged_names(sorted(names), loop, code, calls)
        return Sentence("%(place)s: %(code)s never ends: %(reason)s", place=location, code=head, reason=explanation)
    equality_indices = [place for place, token in enumerate(condition) if token in ("!=", "==")]
    if (
        equality_indices
        and any(token in PROPERTIES for token in condition)
        and any(each[:1].isdigit() for each in condition)
    ):
        return Sentence(
            "%(place)s: %(code)s does not end: the value can jump past the number between two readings. Compare with "
            "%(less)s or %(greater)s",
            place=location,
            code=head,
            less="<",
            greater=">",
        )
    return ""


def _describe_effect(effect: str, statement: Statement, loop: Statement, listing: Listing, advice: str) -> str:
    """Return a hint on a statement whose effect is that a loop never ends."""
    return Sentence(
        "%(place)s: %(effect)s, so the loop in line %(line)s, %(code)s, never ends. %(advice)s",
        place=listing.locate(statement.line),
        effect=effect,
        line=loop.line,
        code=join_tokens(loop.tokens)[:-1],
        advice=advice,
    )


def _find_wrong_step(loop: Statement, body: Sequence[Statement]) -> tuple[Statement, str, str] | None:
    """Return the statement that moves a counter away from its limit, its effect, and the fix; otherwise None."""
    condition = loop.condition
    if len(condition) < 3 or condition[1] not in _DIVERGING_SIGNS or not is_name(condition[0]):
        return None
    name, sign = condition[0], condition[1]
    for statement in body:
        if statement.parent != loop.number:
            continue
        step_code = join_tokens(statement.tokens)
        if statement.target == name and len(statement.tokens) == 3 and not is_name(statement.tokens[2]):
            effect = Sentence("%(code)s gives %(name)s the same value in each pass", code=step_code, name=name)
            return statement, effect, Sentence("Move it to the line before the loop, without indentation")
        direction = _find_step_sign(statement, name)
        if direction == _DIVERGING_SIGNS[sign]:
            is_growing = direction == "+"
            template = translatable("%(code)s makes %(name)s grow")
            template = template if is_growing else translatable("%(code)s makes %(name)s shrink")
            fix = Sentence("Write %(right)s instead of %(wrong)s", right="-" if is_growing else "+", wrong=direction)
            return statement, Sentence(template, code=step_code, name=name), fix
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
        names = statement.bound_names if _is_reading(statement) and "=" in statement.tokens else frozenset()
        if names and not names & assigned_names and any(one.has_token(*names) for one in (*body, loop)):
            return _describe_single_reading(statement, body)
    return ""


def _describe_single_reading(assignment: Statement, body: Sequence[Statement]) -> str:
    """Return that a value is read once, or that the loop reads it again under a name with other capital letters."""
    other = next((each for each in body if each.target and each.target.lower() == assignment.target.lower()), None)
    if other is not None:
        return Sentence(
            "%(name)s is read once, in line %(line)s, and not again. Line %(other)s writes %(wrong)s: write %(name)s, "
            "because capital and small letters differ",
            name=assignment.target,
            line=assignment.line,
            other=other.line,
            wrong=other.target,
        )
    return Sentence(
        "%(name)s is read once, in line %(line)s, and not again. Repeat %(code)s in the loop",
        name=join_tokens(assignment.tokens[: assignment.tokens.index("=")]),
        line=assignment.line,
        code=join_tokens(assignment.tokens),
    )


def _describe_repetition(head: str, body: Sequence[Statement], fault: Fault) -> str:
    """Return that a loop has no end, and what it lacks."""
    is_robot = fault.who != "responder"
    lacks_wait = is_robot and fault.verdict is Verdict.CPU_LIMIT
    lacks_reading = is_robot and not any(_is_reading(each) for each in body)
    if lacks_wait and lacks_reading:
        template = translatable("%(code)s repeats for ever, and nothing in it waits and it reads no sensor")
    elif lacks_wait:
        template = translatable("%(code)s repeats for ever, and nothing in it waits")
    elif lacks_reading:
        template = translatable("%(code)s repeats for ever, and it reads no sensor")
    else:
        template = translatable("%(code)s repeats for ever")
    return Sentence(template, code=head)


def _suggest_loop_end(body: Sequence[Statement], fault: Fault) -> str:
    if fault.who == "responder":
        return Sentence("End it with break, or write a condition instead of True")
    if fault.verdict is Verdict.CPU_LIMIT:
        return Sentence("Read a sensor in its condition, or add time.sleep(0.1) and end it with break")
    return Sentence("End it with break, write a condition that reads a sensor, or remove the loop")


def explain_always_true(condition: Sequence[str], code: CodeStatements) -> str:
    """Return why a comparison of a reading with a number is always true; empty if it is not."""
    sign_index = next((at for at, token in enumerate(condition) if token in ("<", ">", "<=", ">=")), None)
    if sign_index is None or any(token in ("and", "or", "not") for token in condition):
        return ""
    sign, name = condition[sign_index], find_reading(condition[:sign_index], code)
    number = code.number(condition[sign_index + 1 :])
    if not name or number is None:
        return ""
    minimum, maximum, _ = READINGS[name]
    is_always_true = {">=": number <= minimum, ">": number < minimum, "<=": number >= maximum, "<": number > maximum}[
        sign
    ]
    if not is_always_true:
        return ""
    advice = (
        Sentence("Write %(sign)s %(number)g", sign=sign[0], number=number)
        if sign in (">=", "<=") and number in (minimum, maximum)
        else Sentence("Choose a number within")
    )
    return Sentence(
        "%(code)s is always true, because %(range)s. %(advice)s",
        code=join_tokens(condition),
        range=describe_reading(name),
        advice=advice,
    )


def describe_reading(name: str) -> str:
    """Return the range and unit of a reading, as a clause."""
    return Sentence(READINGS[name][2], reading=name)


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
    for name in names:
        assignment = next(
            (each for each in code.statements[: loop.number] if name in each.bound_names and _is_reading(each)), None
        )
        if assignment is not None:
            return _describe_single_reading(assignment, code.list_body(loop))
    if len(names) == 1:
        return Sentence("%(name)s does not change in the loop. Assign %(name)s in the loop", name=names[0])
    return Sentence(
        "%(first)s and %(second)s do not change in the loop. Assign %(first)s in the loop",
        first=names[0],
        second=names[1],
    )


def _is_reading(statement: Statement) -> bool:
    return any(token in PROPERTIES or token in ("get_clock", "pyState") for token in statement.tokens)


def _is_waiting(loop: Statement, code: CodeStatements) -> bool:
    """Return whether the loop takes simulated time. Reading the state of a motor takes none."""
    return any(token in _WAITS for each in (loop, *code.list_body(loop)) for token in each.tokens)
