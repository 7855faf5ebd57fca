"""Hints on valid steps that do something else than intended, as the lost marks show.

Examples: a loop that counts from 1, the first message instead of the last, a name in quotes, a wrong turn.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterator

from service.grading.findings import OtherWord
from service.grading.hint_clues import Clues, Listing
from service.grading.hint_code import LOOPS, CallInCode, Statement, join_tokens
from service.grading.hint_slips import format_arguments
from service.grading.hint_structure import DRIVING_CRITERIA, collect_statements, has_motor_call
from service.grading.hint_tables import LIMITED_MOVES
from service.grading.judging.geometry import to_relative_position
from service.language import translatable
from sim.recording import Pose, Recording
from sim.sentences import Sentence, iterate_values
from submissions.criteria.ending import EndPose
from submissions.criteria.motion import Excursions
from submissions.criteria.sequence import WordSequence
from submissions.criteria.texts import Says, TextSequence

_FIRST_VALUE_NAME = re.compile(r"(?:\w+_)?(?:begin|beginning|start|first)(?:_\w+)?\Z", re.IGNORECASE)
_AWAY = 60.0
_INTEGER = re.compile(r"-?\d+")


def hint_about_range_start(clues: Clues) -> Iterator[str]:
    """Yield a hint on ``range(1, SIDES)`` with an unused loop variable, if one iteration is missing."""
    if not any(isinstance(each, (*DRIVING_CRITERIA, WordSequence)) for each in clues.lost):
        return
    for listing, statement in collect_statements(clues):
        call = next((one for one in statement.calls if one.name == "range"), None)
        if statement.keyword != "for" or call is None or len(call.arguments) != 2 or call.arguments[0] != ("1",):
            continue
        end, variable = listing.code.number(call.arguments[1]), statement.tokens[1]
        is_used = any(one.has_token(variable) for one in listing.code.list_body(statement))
        pass_counts = {end, end - 1} if end is not None and end > 1 else set()
        number_sets = (_collect_values(clues, one.id) for one in clues.lost)
        if end is not None and pass_counts and not is_used and any(pass_counts <= numbers for numbers in number_sets):
            yield Sentence(
                "%(place)s: range(1, %(end)s) counts from 1 to %(last)g, so the loop runs %(last)g times. To run "
                "%(count)g times, write range(%(end)s)",
                place=listing.locate(statement.line),
                end=join_tokens(call.arguments[1]),
                last=end - 1,
                count=end,
            )
            return


def hint_about_range_step(clues: Clues) -> Iterator[str]:
    """Yield a hint on ``range(10, 101)``, if the required numbers have a larger step."""
    for criterion in clues.lost:
        word = clues.find_finding(criterion, OtherWord)
        words = (word.previous[0], word.actual, word.expected[0]) if word and len(word.previous) == 1 else ()
        if not words or not all(map(_INTEGER.fullmatch, words)):
            continue
        last_number, actual, expected = map(int, words)
        for listing, statement in collect_statements(clues):
            call = next((one for one in statement.calls if one.name == "range"), None)
            numbers = [listing.code.number(one) for one in call.arguments] if call is not None else []
            start, end, step = (*numbers, 1.0, 1.0)[:3] if len(numbers) in (2, 3) else (None, None, None)
            if (
                call is None
                or start is None
                or end is None
                or step != actual - last_number
                or not start <= last_number < end
            ):
                continue
            arguments = (*map(join_tokens, call.arguments[:2]), str(expected - last_number))
            yield Sentence(
                "%(place)s: range(%(arguments)s) counts in steps of %(step)g, so %(actual)s comes after %(last)s, and "
                "not %(expected)s. The third number is the step: write range(%(fixed)s)",
                place=listing.locate(statement.line),
                arguments=format_arguments(call.arguments),
                step=step,
                actual=actual,
                last=last_number,
                expected=expected,
                fixed=", ".join(arguments),
            )
            return


def hint_about_large_step(clues: Clues) -> Iterator[str]:
    """Yield a hint on ``range(0, 5, 2)`` that leaves out numbers that must be printed, said or sent."""
    for criterion in clues.lost:
        texts = criterion.in_order if isinstance(criterion, TextSequence) else ()
        required = {int(each) for each in texts if each.isdecimal()}
        for listing, statement in collect_statements(clues) if required else ():
            call = next((one for one in statement.calls if one.name == "range"), None)
            numbers = [listing.code.number(one) for one in call.arguments] if call is not None else []
            if call is None or len(numbers) != 3 or None in numbers or statement.keyword != "for":
                continue
            start, end, step = (int(each) for each in numbers if each is not None)
            left_out = sorted(required & set(range(start, end)) - set(range(start, end, step))) if step > 1 else []
            if left_out:
                yield Sentence(
                    "%(place)s: range(%(arguments)s) counts in steps of %(step)s, and leaves out %(number)s. "
                    "Write range(%(start)s, %(end)s)",
                    place=listing.locate(statement.line),
                    arguments=format_arguments(call.arguments),
                    step=step,
                    number=left_out[0],
                    start=start,
                    end=end,
                )
                return


def hint_about_first_value(clues: Clues) -> Iterator[str]:
    """Yield a hint on a variable for the first value that each later value overwrites."""
    for listing, statement in collect_statements(clues):
        name = statement.target
        enclosing = next((one for one in listing.code.list_enclosing(statement)), None)
        if (
            not _FIRST_VALUE_NAME.match(name)
            or enclosing is None
            or enclosing.keyword != "if"
            or name in enclosing.condition
        ):
            continue
        is_empty = any(one.tokens == (name, "=", "None") and not one.indent for one in listing.code.statements)
        if is_empty and any(one.keyword in LOOPS for one in listing.code.list_enclosing(statement)):
            yield Sentence(
                "%(place)s sets %(name)s again each time that the if in line %(line)s is true, so it has the "
                'last value. For the first, write "if %(condition)s and %(name)s is None:"',
                place=listing.locate(statement.line),
                name=name,
                line=enclosing.line,
                condition=join_tokens(enclosing.condition),
            )
            return


def hint_about_first_message(clues: Clues) -> Iterator[str]:
    """Yield a hint on code that reads the first message of the queue, if the last is required."""
    if not any(isinstance(each, Says) and each.last for each in clues.lost):
        return
    for listing, statement in collect_statements(clues):
        for index, token in enumerate(statement.tokens):
            if token.strip("\"'") == "messages" and statement.tokens[index + 1 : index + 5] == ("]", "[", "0", "]"):
                yield Sentence(
                    "%(place)s takes the first message of the queue, [0]. Write [-1] for the last",
                    place=listing.locate(statement.line),
                )
                return


def hint_about_spoken_name(clues: Clues) -> Iterator[str]:
    """Yield a hint on ``say("count")``: a variable's name instead of its value."""
    for listing, statement in collect_statements(clues):
        for call in statement.calls:
            text = call.arguments[0][0] if call.arguments and len(call.arguments[0]) == 1 else ""
            name = text[1:-1]
            is_output = call.name in ("say", "print") and name in (*clues.spoken, *clues.printed)
            if is_output and text[:1] in ("'", '"') and _is_variable(name, listing):
                arguments = format_arguments((("str", "(", name, ")"), *call.arguments[1:]))
                template = (
                    translatable(
                        "%(place)s says the word %(text)s and not the value of %(name)s, because it is in quotes. "
                        "Write say(%(arguments)s)"
                    )
                    if call.name == "say"
                    else translatable(
                        "%(place)s prints the word %(text)s and not the value of %(name)s, because it is in quotes. "
                        "Write print(%(arguments)s)"
                    )
                )
                yield Sentence(
                    template, place=listing.locate(statement.line), text=text, name=name, arguments=arguments
                )
                return


def _is_variable(name: str, listing: Listing) -> bool:
    statements = listing.code.statements
    return any(name == each.target or (each.keyword == "for" and name in each.bound_names) for each in statements)


def hint_about_unused_parameter(clues: Clues) -> Iterator[str]:
    """Yield a hint on a function that drives without using one of its parameters."""
    for listing in clues.programs if any(isinstance(each, DRIVING_CRITERIA) for each in clues.lost) else ():
        for head in listing.code.list_functions():
            body = listing.code.list_body(head)
            drive_statement = next((each for each in body if has_motor_call(each, LIMITED_MOVES)), None)
            name = head.tokens[1]
            if drive_statement is None or not any(
                call.name == name for each in listing.code.statements for call in each.calls
            ):
                continue
            for parameter in _list_parameters(head):
                if not any(each.has_token(parameter) for each in body):
                    call = next(one for one in drive_statement.calls if one.name.rpartition(".")[2] in LIMITED_MOVES)
                    place = listing.locate(drive_statement.line)
                    if not call.arguments:
                        yield Sentence(
                            "%(place)s: %(name)s never uses its parameter %(parameter)s, so it does the same with "
                            "each value. Write %(parameter)s instead of the number if that is meant",
                            place=place,
                            name=name,
                            parameter=parameter,
                        )
                        return
                    yield Sentence(
                        "%(place)s: %(name)s never uses its parameter %(parameter)s, so it does the same with "
                        "each value. Write %(parameter)s instead of %(amount)s if that is meant",
                        place=place,
                        name=name,
                        parameter=parameter,
                        amount=join_tokens(call.arguments[-1]),
                    )
                    return


def hint_about_missing_reverse(clues: Clues) -> Iterator[str]:
    """Yield a hint on a program that only drives forwards, if the robot should come back."""
    if not any(isinstance(each, Excursions) for each in clues.lost):
        return
    moves = [(listing, each) for listing, each in collect_statements(clues) if has_motor_call(each, LIMITED_MOVES)]
    calls = [call for _, each in moves for call in each.calls if call.name.rpartition(".")[2] in LIMITED_MOVES]
    for listing, statement in moves:
        if any(_has_opposite_speeds(listing, call) for call in statement.calls):
            yield Sentence(
                "%(place)s turns the robot on the spot, because only one speed has a minus. To drive backwards, "
                "write - before both speeds",
                place=listing.locate(statement.line),
            )
            return
    has_turn = any("turn" in call.name or "-" in "".join(map("".join, call.arguments)) for call in calls)
    if len(moves) > 1 and not has_turn:
        listing, statement = moves[-1]
        yield Sentence(
            "%(place)s drives forwards like the lines before it, so the robot never comes back. Write - before "
            "both speeds to drive backwards",
            place=listing.locate(statement.line),
        )


def _has_opposite_speeds(listing: Listing, call: CallInCode) -> bool:
    """Return whether the wheels turn against each other, with the same speed."""
    if not call.name.startswith("tank_drive.") or len(call.arguments) < 2:
        return False
    texts = ["".join(each).replace("-", "") for each in call.arguments[:2]]
    return texts[0] == texts[1] and ("-" in call.arguments[0]) != ("-" in call.arguments[1])


def hint_about_mirrored_end(clues: Clues) -> Iterator[str]:
    """Yield a hint on an end position mirrored at the last straight line: the last turn went the wrong way."""
    for criterion in clues.lost:
        if not isinstance(criterion, EndPose) or criterion.x is None or criterion.y is None:
            continue
        for recording in clues.recordings:
            corner = _find_last_corner(recording)
            turn = _find_last_turn(clues)
            if corner is None or turn is None:
                continue
            target = to_relative_position(corner, criterion.x, criterion.y)
            end = to_relative_position(corner, recording.end.x, recording.end.y)
            error = math.hypot(target[0] - end[0], target[1] + end[1])
            if abs(target[1]) > _AWAY and target[1] * end[1] < 0 and error < max(criterion.tolerance, _AWAY):
                listing, statement = turn
                template = (
                    translatable(
                        "%(place)s turns the robot to the wrong side: it ends as far from its way as the target, but "
                        "on the other side. Turn left there"
                    )
                    if target[1] > 0
                    else translatable(
                        "%(place)s turns the robot to the wrong side: it ends as far from its way as the target, but "
                        "on the other side. Turn right there"
                    )
                )
                yield Sentence(template, place=listing.locate(statement.line))
                return


def _find_last_turn(clues: Clues) -> tuple[Listing, Statement] | None:
    """Return the last statement outside functions that turns the robot, directly or by a function; or None."""
    last_turn = None
    for listing, statement in collect_statements(clues):
        turn_functions = {
            head.tokens[1]
            for head in listing.code.list_functions()
            if any(call.name.startswith("tank_turn.") for one in listing.code.list_body(head) for call in one.calls)
        }
        is_outside = not any(one.keyword == "def" for one in listing.code.list_enclosing(statement))
        if is_outside and any(
            call.name.startswith("tank_turn.") or call.name in turn_functions for call in statement.calls
        ):
            last_turn = listing, statement
    return last_turn


def _find_last_corner(recording: Recording) -> Pose | None:
    """Return the pose where the robot began its last turn, with the heading before it; None if it did not turn."""
    headings = [recording.start.heading, *recording.ticks.heading]
    index = len(headings) - 1
    while index > 0 and abs(headings[index] - headings[index - 1]) < 0.02:
        index -= 1
    while index > 0 and abs(headings[index] - headings[index - 1]) >= 0.02:
        index -= 1
    if index <= 0:
        return None
    return Pose(float(recording.ticks.x[index - 1]), float(recording.ticks.y[index - 1]), float(headings[index]))


def _list_parameters(head: Statement) -> list[str]:
    """Return the parameters without a default value."""
    tokens = head.tokens
    return [
        token
        for place, token in enumerate(tokens[3:-2], 3)
        if tokens[place - 1] in "(," and tokens[place + 1] in ",)" and token.isidentifier()
    ]


def _collect_values(clues: Clues, identity: str) -> set[object]:
    """Return the values in the messages of a criterion: the numbers that it expected and found, among others."""
    result = next((each for each in clues.results if each.id == identity), None)
    messages = (result.message, *(each.message for each in result.evidence)) if result is not None else ()
    return {value for message in messages for _, value in iterate_values(message)}
