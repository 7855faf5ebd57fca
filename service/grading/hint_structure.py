"""Hints on programs that finish but do too little: code that is never called, waited for or repeated.

They apply only if visible criteria lost marks, and the message says what did not happen.
"""

from __future__ import annotations

import keyword
import re
from collections.abc import Iterator

from service.grading.hint_clues import Clues, Listing
from service.grading.hint_code import LOOPS, CodeStatements, Statement, is_name, join_tokens
from service.grading.hint_tables import ACTIONS, CONTINUOUS_MOVES, LIMITED_MOVES, PROPERTIES
from service.language import translatable
from sim.sentences import Sentence, join_with_and
from submissions.criteria.code import Functions
from submissions.criteria.drawing import Drawing
from submissions.criteria.line import Follows, Laps
from submissions.criteria.logs import Datalog
from submissions.criteria.motion import Displacement, Encounters, Excursions, Moves
from submissions.criteria.path import Visits
from submissions.criteria.point import Circuits
from submissions.criteria.sequence import WordSequence
from submissions.criteria.texts import TextSequence

#: Criteria that fail if the robot does not move.
DRIVING_CRITERIA = (Circuits, Displacement, Drawing, Encounters, Excursions, Follows, Laps, Moves, Visits)
_STOP_METHODS = frozenset({"off", "stop"})
_OUTPUT_FUNCTIONS = frozenset({"say", "print"})
_TEXT = re.compile(r"""[fbru]{0,2}["']""", re.IGNORECASE)
_KEYWORDS = frozenset(keyword.kwlist)
_SHORT_RUN_SECONDS = 1.0


def hint_about_missing_brackets(clues: Clues) -> Iterator[str]:
    """Yield a hint on a function that is named as a statement, and so not called."""
    for listing, statement in collect_statements(clues):
        name = join_tokens(statement.tokens)
        last_token = statement.tokens[-1]
        function_names = {function.tokens[1] for function in listing.code.list_functions()}
        is_dotted = all(is_name(token) or token == "." for token in statement.tokens)
        if is_dotted and (
            name in function_names
            or (last_token in ACTIONS and (len(statement.tokens) > 1 or name in _OUTPUT_FUNCTIONS))
        ):
            head = next((each for each in listing.code.list_functions() if each.tokens[1] == name), None)
            parameters = [] if head is None else _list_required_parameters(head)
            template = (
                translatable(
                    "%(place)s names %(name)s without brackets, so it is not called. Write %(name)s(...), with a value "
                    "for %(parameters)s"
                )
                if parameters
                else translatable("%(place)s names %(name)s without brackets, so it is not called. Write %(name)s()")
            )
            yield Sentence(
                template, place=listing.locate(statement.line), name=name, parameters=join_with_and(parameters)
            )
            return


def _list_required_parameters(head: Statement) -> list[str]:
    """Return the parameters of a function that have no value of their own."""
    end = len(head.tokens) - 1 - head.tokens[::-1].index(")") if ")" in head.tokens else 0
    pairs = zip(head.tokens[3:end], head.tokens[4 : end + 1], strict=True)
    return [name for name, sign in pairs if is_name(name) and sign in (",", ")")]


def hint_about_replaced_function(clues: Clues) -> Iterator[str]:
    """Yield a hint on ``say = ...``, which overwrites a function instead of calling it."""
    for listing, statement in collect_statements(clues):
        if statement.target in _OUTPUT_FUNCTIONS and _TEXT.match(statement.tokens[2]):
            yield Sentence(
                "%(place)s replaces %(name)s with a text, and does not call it. Write %(name)s(%(value)s)",
                place=listing.locate(statement.line),
                name=statement.target,
                value=join_tokens(statement.tokens[2:]),
            )
            return


def hint_about_uncalled_function(clues: Clues) -> Iterator[str]:
    """Yield a hint on a function with an effect that is never called."""
    if not clues.lost:
        return
    for listing in clues.programs:
        heads = {each.tokens[1]: each for each in listing.code.list_functions()}
        used_names = {token for each in listing.code.statements if each.keyword != "def" for token in each.tokens}
        idle_statements = {
            number
            for name, head in heads.items()
            if name not in used_names
            for number in _list_statement_numbers(listing, head)
        }
        achieved_effects = {
            _classify_effect(call.name)
            for each in listing.code.statements
            if each.number not in idle_statements
            for call in each.calls
        }
        for name, head in heads.items():
            effects = {_classify_effect(call.name) for each in listing.code.list_body(head) for call in each.calls} - {
                ""
            }
            if name not in used_names and effects and not effects & achieved_effects:
                yield Sentence(
                    "%(place)s defines %(name)s, but it is never called. Write %(call)s below the "
                    "function, at the start of a line",
                    place=listing.locate(head.line),
                    name=name,
                    call=_format_call(head),
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
    called_listings = (
        clues.responder_process_listings if any(isinstance(each, Functions) for each in clues.lost) else ()
    )
    called_statements = ((listing, each) for listing in called_listings for each in listing.code.statements)
    for listing, statement in (*collect_statements(clues), *called_statements):
        effect = describe_discarded_value(statement, listing.code)
        if effect:
            place, advice = listing.locate(statement.line), suggest_correct_statement(statement)
            yield Sentence("%(place)s: %(problem)s. %(advice)s", place=place, problem=effect, advice=advice)
            return


def hint_about_single_reading(clues: Clues) -> Iterator[str]:
    """Yield a hint on ``if`` on a sensor where the robot should continue until a reading."""
    if clues.seconds > _SHORT_RUN_SECONDS and not clues.is_stationary:
        return
    for listing, statement in collect_statements(clues):
        is_reading = statement.keyword == "if" and any(token in PROPERTIES for token in statement.condition)
        is_driving = any(
            has_motor_call(other, CONTINUOUS_MOVES) for other in listing.code.statements[: statement.number]
        )
        is_waiting = any(
            other.keyword == "while" and other.has_token(*PROPERTIES)
            for other in listing.code.statements[: statement.number]
        )
        if is_reading and is_driving and not is_waiting and not listing.code.list_enclosing_loops(statement):
            yield Sentence(
                "%(place)s reads the sensor only once, because if does not repeat. To repeat as long as this is "
                "true, write while %(condition)s",
                place=listing.locate(statement.line),
                condition=join_tokens(statement.tokens[1:]),
            )
            return


def hint_about_stop_in_loop(clues: Clues) -> Iterator[str]:
    """Yield a hint on motors that are switched off in the loop where they should run."""
    for listing, statement in collect_statements(clues):
        body = listing.code.list_body(statement) if statement.keyword == "while" else ()
        direct_statements = [one for one in body if one.parent == statement.number]
        stop = next((one for one in direct_statements if has_motor_call(one, _STOP_METHODS)), None)
        if stop is None or any(
            has_motor_call(one, CONTINUOUS_MOVES | LIMITED_MOVES) or one.keyword in ("break", "if")
            for one in direct_statements
        ):
            continue
        if any(has_motor_call(one, CONTINUOUS_MOVES) for one in listing.code.statements[: statement.number]):
            yield Sentence(
                "%(place)s switches the motors off in the loop in line %(line)s, so the robot stops in the "
                "first pass of the loop. Move the line below the loop: remove its indentation",
                place=listing.locate(stop.line),
                line=statement.line,
            )
            return


def hint_about_unindented_statement(clues: Clues) -> Iterator[str]:
    """Yield a hint on a statement after a loop that should be inside it."""
    is_driving_required = any(isinstance(each, DRIVING_CRITERIA) for each in clues.lost)
    for listing, statement in collect_statements(clues):
        following = listing.code.find_next_outside(statement) if statement.keyword == "for" else None
        if following is None or following.indent != statement.indent or following.keyword in LOOPS:
            continue
        variable = statement.tokens[1]
        is_variable_used = (
            is_name(variable)
            and following.has_token(variable)
            and variable not in following.bound_names
            and following.keyword != "def"
        )
        is_move_repeated = (
            is_driving_required
            and has_motor_call(following, LIMITED_MOVES)
            and any(has_motor_call(one, LIMITED_MOVES) for one in listing.code.list_body(statement))
        )
        if is_variable_used or is_move_repeated:
            yield Sentence(
                "%(place)s is outside the loop of line %(line)s, so it runs only once, after it. If it belongs "
                "to the loop, indent it like the lines above",
                place=listing.locate(following.line),
                line=statement.line,
            )
            return


def hint_about_output_below_loop(clues: Clues) -> Iterator[str]:
    """Yield a hint on a text with a loop's value that is said or printed once, below the loop, and not in it."""
    if not any(isinstance(each, WordSequence | TextSequence | Datalog) for each in clues.lost):
        return
    for listing, statement in collect_statements(clues):
        following = listing.code.find_next_outside(statement) if statement.keyword == "while" else None
        if following is None or following.indent != statement.indent or not _is_output(following):
            continue
        body = listing.code.list_body(statement)
        names = {name for each in body for name in each.bound_names}
        if following.has_token(*names) and not any(map(_is_output, body)):
            yield Sentence(
                "%(place)s is below the loop of line %(line)s, so it runs only once, after it. Move it into the "
                "loop: indent it like the lines above, before the value changes",
                place=listing.locate(following.line),
                line=statement.line,
            )
            return


def _is_output(statement: Statement) -> bool:
    return any(call.name in _OUTPUT_FUNCTIONS for call in statement.calls)


def collect_statements(clues: Clues) -> Iterator[tuple[Listing, Statement]]:
    """Yield the statements of all robot programs, if marks were lost."""
    if clues.lost:
        yield from ((listing, each) for listing in clues.programs for each in listing.code.statements)


def has_motor_call(statement: Statement, methods: frozenset[str]) -> bool:
    """Return whether the statement calls one of these methods of a motor or motor pair."""
    return any("." in call.name and call.name.rpartition(".")[2] in methods for call in statement.calls)


def _format_call(head: Statement) -> str:
    return f"{head.tokens[1]}()" if head.tokens[2:5] == ("(", ")", ":") else f"{head.tokens[1]}(...)"


def describe_discarded_value(statement: Statement, code: CodeStatements) -> str:
    """Return a hint that a statement computes a value and discards it; empty if it has an effect."""
    tokens = statement.tokens
    if _has_reversed_operator(statement, code):
        return Sentence(
            "%(code)s sets %(name)s to %(value)s",
            code=f"{tokens[0]} ={tokens[2]} {tokens[3]}",
            name=tokens[0],
            value=f"{tokens[2]}{tokens[3]}",
        )
    operators = [token for token in tokens if token in ("+", "-", "*", "/", "==", "<", ">")]
    if not is_name(tokens[0]) or not operators or any(each.endswith("=") and each != "==" for each in tokens):
        return ""
    is_plain = all(is_name(each) or each in "+-*/.==<>" or each[0].isdigit() for each in tokens)
    if not is_plain or tokens[0] in _KEYWORDS:
        return ""
    return Sentence("%(code)s has no effect", code=join_tokens(tokens))


def _has_reversed_operator(statement: Statement, code: CodeStatements) -> bool:
    """Return whether this is ``count =- 1``, spaced so, in a loop, for a variable assigned earlier."""
    tokens, columns, name = statement.tokens, statement.columns, statement.target
    if len(tokens) != 4 or not name or name.isupper() or tokens[2] not in ("+", "-"):
        return False
    is_written_so = columns[2] == columns[1] + 1 and columns[3] > columns[2] + 1
    has_value = any(each.target == name for each in code.statements[: statement.number])
    return is_written_so and has_value and bool(code.list_enclosing_loops(statement))


def suggest_correct_statement(statement: Statement) -> str:
    """Return the correct form of a statement without effect."""
    tokens = statement.tokens
    if tokens[1] == "=":
        return Sentence("Write %(code)s", code=f"{tokens[0]} {tokens[2]}= {tokens[3]}")
    if tokens[1] == "==":
        return Sentence("Write one = for an assignment: %(code)s", code=f"{tokens[0]} = {join_tokens(tokens[2:])}")
    return Sentence("Write %(code)s", code=f"{tokens[0]} = {join_tokens(tokens)}")
