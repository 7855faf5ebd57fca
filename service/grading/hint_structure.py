"""Hints on programs that finish but do too little: code that is never called, waited for or repeated.

They apply only if visible criteria lost marks, and the message says what did not happen.
"""

from __future__ import annotations

import re
from collections.abc import Iterator

from service.grading.hint_clues import Clues, Listing
from service.grading.hint_code import LOOPS, Statement, is_name, join_tokens
from service.grading.hint_loops import describe_discarded_value, suggest_correct_statement
from service.grading.hint_tables import ACTIONS, CONTINUOUS_MOVES, LIMITED_MOVES, PROPERTIES
from submissions.criteria.code import Functions
from submissions.criteria.drawing import Drawing
from submissions.criteria.line import Follows, Laps
from submissions.criteria.motion import Displacement, Encounters, Excursions, Moves
from submissions.criteria.path import Visits
from submissions.criteria.point import Circuits

#: Criteria that fail if the robot does not move.
DRIVING_CRITERIA = (Circuits, Displacement, Drawing, Encounters, Excursions, Follows, Laps, Moves, Visits)
_STOP_METHODS = frozenset({"off", "stop"})
_OUTPUT_FUNCTIONS = frozenset({"say", "print"})
_TEXT = re.compile(r"""[fbru]{0,2}["']""", re.IGNORECASE)
_SHORT_RUN_SECONDS = 1.0


def hint_about_missing_brackets(clues: Clues) -> Iterator[str]:
    """Yield a hint on a function that is named as a statement, and so not called."""
    for listing, each in collect_statements(clues):
        name = join_tokens(each.tokens)
        last = each.tokens[-1]
        own = {function.tokens[1] for function in listing.code.list_functions()}
        dotted = all(is_name(token) or token == "." for token in each.tokens)
        if dotted and (name in own or (last in ACTIONS and (len(each.tokens) > 1 or name in _OUTPUT_FUNCTIONS))):
            yield f"{listing.locate(each.line)} names {name} without brackets, so it is not called. Write {name}()"
            return


def hint_about_replaced_function(clues: Clues) -> Iterator[str]:
    """Yield a hint on ``say = ...``, which overwrites a function instead of calling it."""
    for listing, each in collect_statements(clues):
        if each.target in _OUTPUT_FUNCTIONS and _TEXT.match(each.tokens[2]):
            value = join_tokens(each.tokens[2:])
            yield (
                f"{listing.locate(each.line)} replaces {each.target} with a text, and does not call it. "
                f"Write {each.target}({value})"
            )
            return


def hint_about_uncalled_function(clues: Clues) -> Iterator[str]:
    """Yield a hint on a function with an effect that is never called."""
    if not clues.lost:
        return
    for listing in clues.programs:
        heads = {each.tokens[1]: each for each in listing.code.list_functions()}
        used = {token for each in listing.code.statements if each.keyword != "def" for token in each.tokens}
        idle = {
            number
            for name, head in heads.items()
            if name not in used
            for number in _list_statement_numbers(listing, head)
        }
        done = {
            _classify_effect(call.name)
            for each in listing.code.statements
            if each.number not in idle
            for call in each.calls
        }
        for name, head in heads.items():
            effects = {_classify_effect(call.name) for each in listing.code.list_body(head) for call in each.calls} - {
                ""
            }
            if name not in used and effects and not effects & done:
                yield (
                    f"{listing.locate(head.line)} defines {name}, but it is never called. Write "
                    f"{_format_call(head)} below "
                    "the function, at the start of a line"
                )
                return


def _list_statement_numbers(listing: Listing, head: Statement) -> Iterator[int]:
    return (each.number for each in listing.code.list_body(head))


def _classify_effect(name: str) -> str:
    """Return the kind of effect of a call: it moves the robot, or says or prints; otherwise empty."""
    action = name.rpartition(".")[2]
    if action in CONTINUOUS_MOVES | LIMITED_MOVES:
        return "moves"
    return "speaks" if action in _OUTPUT_FUNCTIONS | {"speak", "beep"} else ""


def hint_about_discarded_value(clues: Clues) -> Iterator[str]:
    """Yield a hint on a statement that computes a value and discards it."""
    called = clues.responder_process_listings if any(isinstance(each, Functions) for each in clues.lost) else ()
    answering = ((listing, each) for listing in called for each in listing.code.statements)
    for listing, each in (*collect_statements(clues), *answering):
        effect = describe_discarded_value(each, listing.code)
        if effect:
            yield f"{listing.locate(each.line)}: {effect}. {suggest_correct_statement(each)}"
            return


def hint_about_single_reading(clues: Clues) -> Iterator[str]:
    """Yield a hint on ``if`` on a sensor where the robot should continue until a reading."""
    if clues.seconds > _SHORT_RUN_SECONDS and not clues.is_stationary:
        return
    for listing, each in collect_statements(clues):
        reads = each.keyword == "if" and any(token in PROPERTIES for token in each.condition)
        drives = any(has_motor_call(other, CONTINUOUS_MOVES) for other in listing.code.statements[: each.number])
        if reads and drives and not listing.code.list_enclosing_loops(each):
            text = join_tokens(each.tokens[1:])
            yield (
                f"{listing.locate(each.line)} reads the sensor only once, because if does not repeat. To repeat "
                "as long as "
                f"this is true, write while {text}"
            )
            return


def hint_about_stop_in_loop(clues: Clues) -> Iterator[str]:
    """Yield a hint on motors that are switched off in the loop where they should run."""
    for listing, each in collect_statements(clues):
        body = listing.code.list_body(each) if each.keyword == "while" else ()
        direct = [one for one in body if one.parent == each.number]
        stop = next((one for one in direct if has_motor_call(one, _STOP_METHODS)), None)
        if stop is None or any(
            has_motor_call(one, CONTINUOUS_MOVES | LIMITED_MOVES) or one.keyword in ("break", "if") for one in direct
        ):
            continue
        if any(has_motor_call(one, CONTINUOUS_MOVES) for one in listing.code.statements[: each.number]):
            yield (
                f"{listing.locate(stop.line)} switches the motors off in the loop in line {each.line}, so the "
                "robot stops "
                "in the first pass of the loop. Move the line below the loop: remove its indentation"
            )
            return


def hint_about_unindented_statement(clues: Clues) -> Iterator[str]:
    """Yield a hint on a statement after a loop that should be inside it."""
    drives = any(isinstance(each, DRIVING_CRITERIA) for each in clues.lost)
    for listing, each in collect_statements(clues):
        below = listing.code.find_next_outside(each) if each.keyword == "for" else None
        if below is None or below.indent != each.indent or below.keyword in LOOPS:
            continue
        variable = each.tokens[1]
        uses = (
            is_name(variable)
            and below.has_token(variable)
            and variable not in below.bound_names
            and below.keyword != "def"
        )
        drives_on = (
            drives
            and has_motor_call(below, LIMITED_MOVES)
            and any(has_motor_call(one, LIMITED_MOVES) for one in listing.code.list_body(each))
        )
        if uses or drives_on:
            yield (
                f"{listing.locate(below.line)} is outside the loop of line {each.line}, so it runs only once, "
                "after it. "
                "If it belongs to the loop, indent it like the lines above"
            )
            return


def collect_statements(clues: Clues) -> Iterator[tuple[Listing, Statement]]:
    """Yield the statements of all robot programs, if marks were lost."""
    if clues.lost:
        yield from ((listing, each) for listing in clues.programs for each in listing.code.statements)


def has_motor_call(statement: Statement, how: frozenset[str]) -> bool:
    """Return whether the statement calls one of these methods of a motor or motor pair."""
    return any("." in call.name and call.name.rpartition(".")[2] in how for call in statement.calls)


def _format_call(head: Statement) -> str:
    return f"{head.tokens[1]}()" if head.tokens[2:5] == ("(", ")", ":") else f"{head.tokens[1]}(...)"
