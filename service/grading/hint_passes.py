"""Hints on the passes of a loop: a value that is kept for the next pass, a first pass with 0, a stale reading.

They apply only if visible criteria lost marks.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence

from service.grading.hint_clues import Clues, Listing
from service.grading.hint_code import LOOPS, CodeStatements, Statement, is_name, join_tokens
from service.grading.hint_motion import measure_missing_way
from service.grading.hint_structure import DRIVING_CRITERIA, collect_statements, has_motor_call
from service.grading.hint_tables import CONTINUOUS_MOVES, LIMITED_MOVES, PROPERTIES
from sim.recording import Message
from sim.sentences import Sentence
from submissions.criteria.motion import Excursions
from submissions.criteria.unreliable_channel import Resends

_CLOCKS = frozenset({"get_clock", "time"})
_COUNTED = frozenset({"and", "or", "not", "is", "None", "True", "False"})


def hint_about_kept_value(clues: Clues) -> Iterator[str]:
    """Yield a hint on an inner ``while`` whose variable gets its first value only once, above the outer loop."""
    for listing, inner in collect_statements(clues):
        outer_loops = [each for each in listing.code.list_enclosing(inner) if each.keyword in LOOPS]
        if inner.keyword != "while" or not outer_loops:
            continue
        outer = outer_loops[0]
        for name in dict.fromkeys(token for token in inner.condition if is_name(token) and token not in _COUNTED):
            first_assignment = _find_kept_assignment(listing.code, name, inner, outer)
            if first_assignment is not None:
                yield Sentence(
                    "%(place)s: %(code)s runs in the first pass of line %(line)s only, because %(name)s keeps "
                    "its last value. Move %(start)s from line %(start_line)s into the loop, below line %(line)s",
                    place=listing.locate(inner.line),
                    code=join_tokens(inner.tokens)[:-1],
                    line=outer.line,
                    name=name,
                    start=join_tokens(first_assignment.tokens),
                    start_line=first_assignment.line,
                )
                return


def _find_kept_assignment(code: CodeStatements, name: str, inner: Statement, outer: Statement) -> Statement | None:
    """Return the only assignment of a start value, if it is above the outer loop and only the inner loop changes it."""
    if outer.has_token(name) or any(each.has_token(name) for each in code.list_enclosing(outer)):
        return None
    inner_numbers = {each.number for each in code.list_body(inner)}
    changes = [each for each in code.list_body(outer) if name in each.bound_names]
    starts = [each for each in code.statements[: outer.number] if each.target == name]
    is_measured = any(each.has_token(*PROPERTIES, *_CLOCKS) for each in changes)
    if not changes or is_measured or any(each.number not in inner_numbers for each in changes):
        return None
    is_start_constant = len(starts) == 1 and len(starts[0].tokens) == 3 and starts[0].indent == outer.indent
    return starts[0] if is_start_constant else None


def hint_about_zero_pass(clues: Clues) -> Iterator[str]:
    """Yield a hint on ``for factor in range(3)`` with a length of 0 in the first pass."""
    if not any(isinstance(each, DRIVING_CRITERIA) for each in clues.lost):
        return
    for listing, statement in collect_statements(clues):
        call = next((each for each in statement.calls if each.name == "range"), None)
        if statement.keyword != "for" or call is None or len(call.arguments) != 1 or len(statement.tokens) < 4:
            continue
        variable, end = statement.tokens[1], listing.code.number(call.arguments[0])
        body = listing.code.list_body(statement)
        lengths = {each.target for each in body if each.target and _is_multiple(each.tokens[2:], variable)}
        amounts = (
            each.arguments[-1]
            for one in body
            for each in one.calls
            if each.name.rpartition(".")[2] in LIMITED_MOVES and each.arguments
        )
        if end and any(_is_multiple(each, variable) or {*each} & lengths or each == (variable,) for each in amounts):
            yield Sentence(
                "%(place)s: range(%(end)g) begins with 0, so %(name)s is 0 in the first pass and the robot "
                "does not move in it. Write range(1, %(right)g)",
                place=listing.locate(statement.line),
                end=end,
                name=variable,
                right=end + 1,
            )
            return


def hint_about_short_loop(clues: Clues) -> Iterator[str]:
    """Yield a hint on a counting loop that ends before the robot is where it should be, with the number of passes."""
    missing_way = measure_missing_way(clues)
    recording = clues.recordings[0] if clues.recordings else None
    if missing_way is None or recording is None:
        return
    covered_way = math.hypot(recording.end.x - recording.start.x, recording.end.y - recording.start.y)
    loops = [pair for pair in collect_statements(clues) if pair[1].keyword == "for" and pair[1].parent == -1]
    for listing, loop in loops if len(loops) == 1 and covered_way else ():
        call = next((each for each in loop.calls if each.name == "range"), None)
        count = listing.code.number(call.arguments[0]) if call is not None and len(call.arguments) == 1 else None
        is_driving = any(has_motor_call(each, CONTINUOUS_MOVES) for each in listing.code.statements[: loop.number])
        if count and is_driving and not any(_waits(each) for each in listing.code.list_body(loop)):
            yield Sentence(
                "%(place)s: the loop does not wait between its passes, and ends %(distance).0f mm before the middle of "
                "the area. Add a time.sleep to it",
                place=listing.locate(loop.line),
                distance=missing_way,
            )
            return
        if count and is_driving:
            yield Sentence(
                "%(place)s: the loop ends %(distance).0f mm before the middle of the area where the robot "
                "should end. Change %(count)g to about %(right).0f",
                place=listing.locate(loop.line),
                distance=missing_way,
                count=count,
                right=count * (1 + missing_way / covered_way),
            )
            return


def _waits(statement: Statement) -> bool:
    return any(each.name.rpartition(".")[2] in LIMITED_MOVES | {"sleep"} for each in statement.calls)


def _is_multiple(tokens: tuple[str, ...], variable: str) -> bool:
    """Return whether a value is a product with the variable."""
    return variable in tokens and "*" in tokens and not {"+", "-"} & set(tokens)


def hint_about_added_factor(clues: Clues) -> Iterator[str]:
    """Yield a hint on ``factor + DISTANCE`` where the ways must be multiples of a distance."""
    if not any(isinstance(each, Excursions) for each in clues.lost):
        return
    for listing, statement in collect_statements(clues):
        value = statement.tokens[2:]
        loop = next((each for each in listing.code.list_enclosing(statement) if each.keyword == "for"), None)
        is_sum = len(value) == 3 and value[1] == "+" and loop is not None and loop.tokens[1] in value
        if not statement.target or not is_sum or loop is None:
            continue
        body = listing.code.list_body(loop)
        if any(has_motor_call(each, LIMITED_MOVES) and each.has_token(statement.target) for each in body):
            yield Sentence(
                "%(place)s adds: %(code)s. For two or three times a distance, multiply: write %(name)s = "
                "%(first)s * %(second)s",
                place=listing.locate(statement.line),
                code=join_tokens(statement.tokens),
                name=statement.target,
                first=value[0],
                second=value[2],
            )
            return


def hint_about_stale_twin(clues: Clues) -> Iterator[str]:
    """Yield a hint on two readings of which a loop renews only one."""
    for listing, loop in collect_statements(clues):
        if loop.keyword != "while":
            continue
        body = listing.code.list_body(loop)
        renewed = [each for each in body if each.target and each.tokens[-1] in PROPERTIES]
        renewed_names = {name for each in body for name in each.bound_names}
        for statement in listing.code.statements[: loop.number]:
            name, reading = statement.target, statement.tokens[2:]
            if not name or name in renewed_names or not any(each.has_token(name) for each in (loop, *body)):
                continue
            has_twin = any(each.tokens[-1] == reading[-1] and each.tokens[2:] != reading for each in renewed)
            if has_twin and _is_paired(listing, statement, renewed):
                yield Sentence(
                    "%(place)s: the loop reads %(twin)s again, but not %(name)s, which is read once, in line "
                    "%(line)s. Repeat %(code)s in the loop",
                    place=listing.locate(loop.line),
                    twin=renewed[0].target,
                    name=name,
                    line=statement.line,
                    code=join_tokens(statement.tokens),
                )
                return


def _is_paired(listing: Listing, statement: Statement, renewed: list[Statement]) -> bool:
    """Return whether a renewed reading was first read beside this one, above the loop."""
    neighbours = listing.code.statements[max(statement.number - 1, 0) : statement.number + 2]
    return any(each.target == one.target for each in neighbours for one in renewed)


def hint_about_hasty_resending(clues: Clues) -> Iterator[str]:
    """Yield a hint on a message that is sent again before an answer can come, with the wait to make longer."""
    for criterion in clues.lost:
        if not isinstance(criterion, Resends):
            continue
        shortest = min((gap for each in clues.recordings for gap in _collect_gaps(each.messages)), default=None)
        if shortest is None or shortest >= criterion.every[0]:
            continue
        for listing, statement in collect_statements(clues):
            call = next((each for each in statement.calls if each.name.rpartition(".")[2] == "sleep"), None)
            seconds = listing.code.number(call.arguments[0]) if call is not None and call.arguments else None
            if seconds is not None and seconds < criterion.every[0] and listing.code.list_enclosing_loops(statement):
                yield Sentence(
                    "%(place)s waits only %(seconds)g s, so the message is sent again before its answer can "
                    "come. Wait %(least)g to %(most)g s, for example with time.sleep(1)",
                    place=listing.locate(statement.line),
                    seconds=seconds,
                    least=criterion.every[0],
                    most=criterion.every[1],
                )
                return


def _collect_gaps(messages: Sequence[Message]) -> Iterator[float]:
    """Yield the seconds between two messages of a robot with the same text."""
    last_times: dict[str, float] = {}
    for message in messages:
        if message.sender == "robot":
            if message.text in last_times:
                yield message.t - last_times[message.text]
            last_times[message.text] = message.t
