"""Hints on robots that stand, go straight or turn by the wrong unit: a move without a wait, a stop before a loop."""

from __future__ import annotations

import re
from collections.abc import Iterator

from service.grading.hint_clues import Clues, Listing
from service.grading.hint_code import CallInCode, join_tokens
from service.grading.hint_motion import STOPPING_CRITERIA
from service.grading.hint_structure import DRIVING_CRITERIA, collect_statements, has_motor_call
from service.grading.hint_tables import CONTINUOUS_MOVES, LIMITED_MOVES, PROPERTIES
from service.language import translatable
from sim.recording import Verdict
from sim.sentences import Sentence
from submissions.criteria.collecting import Collects

_PAIRS = frozenset({"tank_drive", "tank_turn"})
_STOPS = frozenset({"off", "stop"})
_MOVES = CONTINUOUS_MOVES | LIMITED_MOVES
_INVERSE_FUNCTIONS = frozenset({"atan2", "atan", "asin", "acos"})
_FUNCTIONS = frozenset({"sin", "cos", "tan"})
#: What a program that converts between radians and degrees contains.
_CONVERSIONS = frozenset({"degrees", "radians", "rad2deg", "deg2rad"})
_NUMBERS = re.compile(r"\b(?:180|57\.\d*|0\.017\d*|3\.14\d*)\b")
_ONE_SIDE = re.compile(r"""["']image_data (?:left|right)["']\Z""")


def hint_about_unwaited_move(clues: Clues) -> Iterator[str]:
    """Yield a hint on motors that are switched on where the next line, or the end, follows at once."""
    if clues.is_stationary or not any(isinstance(each, DRIVING_CRITERIA + STOPPING_CRITERIA) for each in clues.lost):
        return
    for listing, statement in collect_statements(clues):
        call = next((each for each in statement.calls if _is_pair_call(each, CONTINUOUS_MOVES)), None)
        if call is None or statement.parent >= 0 or not _has_speed(listing, call):
            continue
        following = next(iter(listing.code.list_following(statement)), None)
        if following is not None and not any(_is_pair_call(each, _STOPS | _MOVES) for each in following.calls):
            continue
        template = (
            translatable(
                "%(place)s switches the motors on, and the program ends at once. Write "
                "%(owner)s.on_for_seconds(...) with the seconds as the last value, or add time.sleep(...)"
            )
            if following is None
            else translatable(
                "%(place)s switches the motors on, and line %(line)s follows at once. Write "
                "%(owner)s.on_for_seconds(...) with the seconds as the last value, or add time.sleep(...)"
            )
        )
        yield Sentence(
            template,
            place=listing.locate(statement.line),
            owner=call.name.partition(".")[0],
            line=0 if following is None else following.line,
        )
        return


def hint_about_stop_before_loop(clues: Clues) -> Iterator[str]:
    """Yield a hint on a loop that waits for another reading while the robot stands still."""
    if not any(each.verdict is Verdict.TIME_LIMIT for each in clues.recordings):
        return
    for listing, loop in collect_statements(clues):
        body = listing.code.list_body(loop) if loop.keyword == "while" and loop.has_token(*PROPERTIES) else ()
        if not body or any(call.name != "time.sleep" and "." in call.name for each in body for call in each.calls):
            continue
        earlier = [each for each in listing.code.statements[: loop.number] if has_motor_call(each, _MOVES | _STOPS)]
        calls_own_function = any(
            call.name in {each.tokens[1] for each in listing.code.list_functions()}
            for each in (*body, *listing.code.statements[: loop.number])
            for call in each.calls
        )
        if not earlier or earlier[-1].parent != loop.parent or calls_own_function:
            continue
        if has_motor_call(earlier[-1], CONTINUOUS_MOVES):
            continue
        yield Sentence(
            "%(place)s: the loop waits for another reading, but the robot stopped in line %(line)s. Switch "
            "the motors on above the loop, with tank_drive.on(10, 10)",
            place=listing.locate(loop.line),
            line=earlier[-1].line,
        )
        return


def hint_about_radians(clues: Clues) -> Iterator[str]:
    """Yield a hint on ``math.atan2(...)`` that turns the robot, or ``math.sin(gyro.angle)``, without a conversion."""
    if not any(isinstance(each, DRIVING_CRITERIA + STOPPING_CRITERIA) for each in clues.lost):
        return
    for listing in clues.programs:
        statements = listing.code.statements
        names = {call.name.rpartition(".")[2] for each in statements for call in each.calls}
        is_converted = names & _CONVERSIONS or any(each.has_token("pi", "tau") for each in statements)
        if is_converted or listing.find_line(_NUMBERS) or (names & _INVERSE_FUNCTIONS and names & _FUNCTIONS):
            continue
        for statement in statements:
            for call in statement.calls:
                name = call.name.rpartition(".")[2]
                code = f"{call.name}({', '.join(join_tokens(each) for each in call.arguments)})"
                if name in _INVERSE_FUNCTIONS:
                    yield Sentence(
                        "%(place)s: %(name)s gives radians, and robots turn by degrees. Write math.degrees(%(code)s)",
                        place=listing.locate(statement.line),
                        name=call.name,
                        code=code,
                    )
                    return
                if name in _FUNCTIONS and len(call.arguments) == 1:
                    yield Sentence(
                        "%(place)s: %(name)s takes radians. If the angle is in degrees, write %(name)s(math.radians("
                        "%(angle)s))",
                        place=listing.locate(statement.line),
                        name=call.name,
                        angle=join_tokens(call.arguments[0]),
                    )
                    return


def hint_about_straight_turn(clues: Clues) -> Iterator[str]:
    """Yield a hint on ``tank_turn`` with the steering 0, if a message was lost because the robot faced away."""
    if not any(each.lost == "facing away" for each in clues.messages):
        return
    turns = [
        (listing, each, call)
        for listing, each in collect_statements(clues)
        for call in each.calls
        if call.name.startswith("tank_turn.") and call.arguments
    ]
    for listing, statement, call in turns[:1] if len(turns) == 1 else ():
        if listing.code.number(call.arguments[0]) == 0:
            yield Sentence(
                "%(place)s steers by 0, so the robot drives straight on. To turn on the spot, write -100 or "
                "100 instead of 0",
                place=listing.locate(statement.line),
            )


def hint_about_single_images(clues: Clues) -> Iterator[str]:
    """Yield a hint on ``image_data left`` where images of both sensors are collected."""
    if not any(isinstance(each, Collects) for each in clues.lost):
        return
    for listing, statement in collect_statements(clues):
        text = next((token for token in statement.tokens if _ONE_SIDE.match(token)), "")
        if text and statement.has_token("print"):
            yield Sentence(
                "%(place)s asks for the image of one sensor. Each image needs its label from the other sensor: write "
                'print("image_data both")',
                place=listing.locate(statement.line),
            )
            return


def hint_about_hurried_images(clues: Clues) -> Iterator[str]:
    """Yield a hint on a loop that sends images while the robot drives, and does not wait between them."""
    for listing, loop in collect_statements(clues):
        body = listing.code.list_body(loop) if loop.keyword == "for" else ()
        is_driving = any(has_motor_call(each, CONTINUOUS_MOVES) for each in listing.code.statements[: loop.number])
        sent = next(
            (each for each in body if each.has_token('"IMG_DATA"', "'IMG_DATA'") and each.has_token("print")), None
        )
        is_waiting = any(
            each.has_token("sleep", "pyState", "while", "wait") or has_motor_call(each, LIMITED_MOVES) for each in body
        )
        calls = {call.name for each in body for call in each.calls}
        is_waiting = is_waiting or any(each.tokens[1] in calls for each in listing.code.list_functions())
        if sent is not None and is_driving and not is_waiting:
            yield Sentence(
                "%(place)s sends all images at once, because nothing in the loop of line %(line)s waits. Add "
                "time.sleep(0.2) below it",
                place=listing.locate(sent.line),
                line=loop.line,
            )
            return


def _is_pair_call(call: CallInCode, methods: frozenset[str]) -> bool:
    owner, _, method = call.name.rpartition(".")
    return owner in _PAIRS and method in methods


def _has_speed(listing: Listing, call: CallInCode) -> bool:
    """Return whether a call switches motors on at a speed other than 0; False for a stop."""
    speeds = call.arguments[1:] if call.name.startswith("tank_turn.") else call.arguments
    return any(listing.code.number(each) != 0 for each in speeds)
