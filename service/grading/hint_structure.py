"""Hints on programs that finish but do too little: code that is never called, waited for or repeated.

They apply only if visible criteria lost marks, and the message says what did not happen.
"""

from __future__ import annotations

import re
from collections.abc import Iterator

from service.grading.hint_advice import ACTIONS, MOVES_FOR, MOVES_ON, PROPERTIES
from service.grading.hint_clues import Clues, Listing
from service.grading.hint_code import LOOPS, Statement, is_name, joined
from service.grading.hint_loops import fix_effect, without_effect
from submissions.criteria.code import Functions
from submissions.criteria.drawing import Drawing
from submissions.criteria.line import Follows, Laps
from submissions.criteria.motion import Displacement, Encounters, Excursions, Moves
from submissions.criteria.path import Visits
from submissions.criteria.point import Circuits

#: Criteria that fail if the robot does not move.
DRIVEN = (Circuits, Displacement, Drawing, Encounters, Excursions, Follows, Laps, Moves, Visits)
_STOPS = frozenset({"off", "stop"})
_SPOKEN = frozenset({"say", "print"})
_TEXT = re.compile(r"""[fbru]{0,2}["']""", re.IGNORECASE)
_SOON = 1.0


def of_unbracketed(clues: Clues) -> Iterator[str]:
    """Yield a hint on a function that is named as a statement, and so not called."""
    for listing, each in statements_of(clues):
        name = joined(each.tokens)
        last = each.tokens[-1]
        own = {function.tokens[1] for function in listing.code.functions()}
        dotted = all(is_name(token) or token == "." for token in each.tokens)
        if dotted and (name in own or (last in ACTIONS and (len(each.tokens) > 1 or name in _SPOKEN))):
            yield f"{listing.at(each.line)} names {name} without brackets, so it is not called. Write {name}()"
            return


def of_replaced(clues: Clues) -> Iterator[str]:
    """Yield a hint on ``say = ...``, which overwrites a function instead of calling it."""
    for listing, each in statements_of(clues):
        if each.target in _SPOKEN and _TEXT.match(each.tokens[2]):
            value = joined(each.tokens[2:])
            yield (
                f"{listing.at(each.line)} replaces {each.target} with a text, and does not call it. "
                f"Write {each.target}({value})"
            )
            return


def of_uncalled(clues: Clues) -> Iterator[str]:
    """Yield a hint on a function with an effect that is never called."""
    if not clues.lost:
        return
    for listing in clues.programs:
        heads = {each.tokens[1]: each for each in listing.code.functions()}
        used = {token for each in listing.code.statements if each.keyword != "def" for token in each.tokens}
        idle = {number for name, head in heads.items() if name not in used for number in _numbers(listing, head)}
        done = {
            _effect(call.name) for each in listing.code.statements if each.number not in idle for call in each.calls
        }
        for name, head in heads.items():
            effects = {_effect(call.name) for each in listing.code.body(head) for call in each.calls} - {""}
            if name not in used and effects and not effects & done:
                yield (
                    f"{listing.at(head.line)} defines {name}, but it is never called. Write {_call_of(head)} below "
                    "the function, at the start of a line"
                )
                return


def _numbers(listing: Listing, head: Statement) -> Iterator[int]:
    return (each.number for each in listing.code.body(head))


def _effect(name: str) -> str:
    """Return the kind of effect of a call: it moves the robot, or says or prints; otherwise empty."""
    action = name.rpartition(".")[2]
    if action in MOVES_ON | MOVES_FOR:
        return "moves"
    return "speaks" if action in _SPOKEN | {"speak", "beep"} else ""


def of_no_effect(clues: Clues) -> Iterator[str]:
    """Yield a hint on a statement that computes a value and discards it."""
    called = clues.answering if any(isinstance(each, Functions) for each in clues.lost) else ()
    answering = ((listing, each) for listing in called for each in listing.code.statements)
    for listing, each in (*statements_of(clues), *answering):
        effect = without_effect(each, listing.code)
        if effect:
            yield f"{listing.at(each.line)}: {effect}. {fix_effect(each)}"
            return


def of_single_look(clues: Clues) -> Iterator[str]:
    """Yield a hint on ``if`` on a sensor where the robot should continue until a reading."""
    if clues.seconds > _SOON and not clues.stood_still:
        return
    for listing, each in statements_of(clues):
        reads = each.keyword == "if" and any(token in PROPERTIES for token in each.condition)
        drives = any(moves(other, MOVES_ON) for other in listing.code.statements[: each.number])
        if reads and drives and not listing.code.loops_around(each):
            text = joined(each.tokens[1:])
            yield (
                f"{listing.at(each.line)} reads the sensor only once, because if does not repeat. To repeat as long as "
                f"this is true, write while {text}"
            )
            return


def of_stop_in_loop(clues: Clues) -> Iterator[str]:
    """Yield a hint on motors that are switched off in the loop where they should run."""
    for listing, each in statements_of(clues):
        body = listing.code.body(each) if each.keyword == "while" else ()
        direct = [one for one in body if one.parent == each.number]
        stop = next((one for one in direct if moves(one, _STOPS)), None)
        if stop is None or any(moves(one, MOVES_ON | MOVES_FOR) or one.keyword in ("break", "if") for one in direct):
            continue
        if any(moves(one, MOVES_ON) for one in listing.code.statements[: each.number]):
            yield (
                f"{listing.at(stop.line)} switches the motors off in the loop in line {each.line}, so the robot stops "
                "in the first pass of the loop. Move the line below the loop: remove its indentation"
            )
            return


def of_unindented(clues: Clues) -> Iterator[str]:
    """Yield a hint on a statement after a loop that should be inside it."""
    drives = any(isinstance(each, DRIVEN) for each in clues.lost)
    for listing, each in statements_of(clues):
        below = listing.code.next_outside(each) if each.keyword == "for" else None
        if below is None or below.indent != each.indent or below.keyword in LOOPS:
            continue
        variable = each.tokens[1]
        uses = is_name(variable) and below.has(variable) and variable not in below.bound and below.keyword != "def"
        drives_on = drives and moves(below, MOVES_FOR) and any(moves(one, MOVES_FOR) for one in listing.code.body(each))
        if uses or drives_on:
            yield (
                f"{listing.at(below.line)} is outside the loop of line {each.line}, so it runs only once, after it. "
                "If it belongs to the loop, indent it like the lines above"
            )
            return


def statements_of(clues: Clues) -> Iterator[tuple[Listing, Statement]]:
    """Yield the statements of all robot programs, if marks were lost."""
    if clues.lost:
        yield from ((listing, each) for listing in clues.programs for each in listing.code.statements)


def moves(statement: Statement, how: frozenset[str]) -> bool:
    """Return whether the statement calls one of these methods of a motor or motor pair."""
    return any("." in call.name and call.name.rpartition(".")[2] in how for call in statement.calls)


def _call_of(head: Statement) -> str:
    return f"{head.tokens[1]}()" if head.tokens[2:5] == ("(", ")", ":") else f"{head.tokens[1]}(...)"
