"""Hints on robots that don't move, or drive or turn differently than required: the line and the difference.

They apply only if visible criteria lost marks.
"""

from __future__ import annotations

from collections.abc import Iterator

from service.grading.findings import OtherTurn
from service.grading.hint_amounts import describe_large_amount
from service.grading.hint_clues import Clues, Listing
from service.grading.hint_code import CallInCode, Statement, join_tokens
from service.grading.hint_loops import describe_reading, find_reading
from service.grading.hint_structure import DRIVING_CRITERIA, collect_statements, has_motor_call
from service.grading.hint_tables import CONTINUOUS_MOVES, LIMITED_MOVES, READINGS
from service.grading.judging.geometry import to_relative_position
from service.grading.judging.message_parts import add_place
from service.language import translatable
from sim.sentences import Sentence
from submissions.criteria import Criterion
from submissions.criteria.drawing import Drawing
from submissions.criteria.ending import EndPose
from submissions.criteria.motion import Displacement, MotionConditions, Moves
from submissions.criteria.stopping import StopOn

#: Criteria that fail if the robot does not stop in time.
STOPPING_CRITERIA = (EndPose, StopOn)
_IMMEDIATE_SECONDS = 0.5
#: A smaller number of degrees moves a wheel by less than 5 mm.
_MIN_DEGREES = 10


def hint_about_stillness(clues: Clues) -> Iterator[str]:
    """Yield a hint on a robot that should have driven and never did."""
    if not clues.is_stationary or not any(
        isinstance(each, DRIVING_CRITERIA + STOPPING_CRITERIA) for each in clues.lost
    ):
        return
    moves = [
        (listing, each)
        for listing, each in collect_statements(clues)
        if has_motor_call(each, CONTINUOUS_MOVES | LIMITED_MOVES)
    ]
    zero_moves = [pair for pair in moves if _is_zero_move(*pair)]
    unwaited_moves = [pair for pair in moves if _has_no_block(pair[1])]
    started_moves = [pair for pair in moves if has_motor_call(pair[1], CONTINUOUS_MOVES)]
    if zero_moves and len(zero_moves) == len(moves):
        listing, statement = zero_moves[0]
        yield Sentence(
            "%(place)s drives with speed or length 0, so the robot never moved. Write a larger number",
            place=listing.locate(statement.line),
        )
    elif unwaited_moves:
        listing, statement = unwaited_moves[0]
        yield Sentence(
            "%(place)s: with block=False the program does not wait, and it ends before the robot moves. Remove "
            "block=False",
            place=listing.locate(statement.line),
        )
    elif started_moves and _list_enclosing_conditions(*started_moves[0]):
        listing, statement = started_moves[0]
        head = _list_enclosing_conditions(listing, statement)[0]
        yield Sentence(
            "%(place)s: the robot never moved. Line %(line)s runs only if %(condition)s is true. Print the values "
            "in it, and check the condition",
            place=listing.locate(head.line),
            line=statement.line,
            condition=join_tokens(head.condition),
        )
    elif started_moves:
        listing, statement = started_moves[0]
        stop_statement = next(
            (
                other
                for other in listing.code.list_following(statement)
                if has_motor_call(other, frozenset({"off", "stop"}))
            ),
            None,
        )
        template = (
            translatable(
                "%(place)s switches the motors on, but nothing waits after it: line %(line)s switches them off at "
                "once, and the robot never moved. Add time.sleep(2), with import time above, or use on_for_seconds"
            )
            if stop_statement
            else translatable(
                "%(place)s switches the motors on, but nothing waits after it: the program ends at once, and the robot "
                "never moved. Add time.sleep(2), with import time above, or use on_for_seconds"
            )
        )
        stop_line = stop_statement.line if stop_statement else 0
        yield Sentence(template, place=listing.locate(statement.line), line=stop_line)
    elif moves and all(_list_enclosing_conditions(*pair) for pair in moves):
        listing, statement = moves[0]
        head = _list_enclosing_conditions(listing, statement)[0]
        yield Sentence(
            "%(place)s moves the robot, but the program never reached it: the robot never moved. Check the "
            "condition in line %(line)s: %(condition)s",
            place=listing.locate(statement.line),
            line=head.line,
            condition=join_tokens(head.condition),
        )
    elif moves or not any(listing.code.statements for listing in clues.programs):
        return
    elif any(isinstance(each, DRIVING_CRITERIA) for each in clues.lost):
        yield Sentence(
            "the robot never moved; expected the program to switch its motors on, for example with "
            "tank_drive.on_for_seconds(20, 20, 1)"
        )


def _has_no_block(statement: Statement) -> bool:
    return any(join_tokens(each) == "block = False" for call in statement.calls for each in call.arguments)


def _list_enclosing_conditions(listing: Listing, statement: Statement) -> list[Statement]:
    """Return the enclosing ``if`` and ``while`` statements that may be false, the innermost first."""
    enclosing_statements = listing.code.list_enclosing(statement)
    return [
        each for each in enclosing_statements if each.keyword in ("if", "elif", "while") and each.condition != ("True",)
    ]


def hint_about_units(clues: Clues) -> Iterator[str]:
    """Yield a hint on an amount in the wrong unit, or a reading compared with a value outside its range."""
    for listing, statement in collect_statements(clues):
        amount_hint = describe_large_amount(listing.code, statement, 0)
        if amount_hint and any(isinstance(lost, DRIVING_CRITERIA + STOPPING_CRITERIA) for lost in clues.lost):
            yield add_place(listing.locate(statement.line), amount_hint)
            return
        degrees_hint = _describe_small_degrees(listing, statement)
        if degrees_hint and any(isinstance(lost, DRIVING_CRITERIA + STOPPING_CRITERIA) for lost in clues.lost):
            yield add_place(listing.locate(statement.line), degrees_hint)
            return
        range_hint = _describe_impossible_threshold(listing, statement)
        if range_hint:
            yield add_place(listing.locate(statement.line), range_hint)
            return


def hint_about_raw_light(clues: Clues) -> Iterator[str]:
    """Yield a hint on raw light, 0 to 255, that is compared with a number for percent."""
    if not any(isinstance(each, STOPPING_CRITERIA) for each in clues.lost):
        return
    for listing, statement in collect_statements(clues):
        sign = next((at for at, token in enumerate(statement.condition) if token in ("<", ">", "<=", ">=")), None)
        if statement.keyword not in ("while", "if") or sign is None:
            continue
        reading = find_reading(statement.condition[:sign], listing.code)
        number = listing.code.number(statement.condition[sign + 1 :])
        is_percent_used = any(each.has_token("reflected_light_intensity_pc") for each in listing.code.statements)
        if reading != "reflected_light_intensity" or number is None or not 0 < number <= 100 or is_percent_used:
            continue
        yield Sentence(
            "%(place)s compares reflected_light_intensity with %(number)g: it goes from 0 to 255. If %(number)g "
            "is in percent, write reflected_light_intensity_pc",
            place=listing.locate(statement.line),
            number=number,
        )
        return


def _describe_small_degrees(listing: Listing, statement: Statement) -> str:
    """Return a hint on ``on_for_degrees`` with a number that can only be rotations; otherwise empty."""
    for call in statement.calls:
        amount = listing.code.number(call.arguments[-1]) if call.arguments else None
        if call.name.rpartition(".")[2] != "on_for_degrees" or not amount or abs(amount) >= _MIN_DEGREES:
            continue
        return Sentence(
            "%(name)s takes degrees, and %(amount)g° of the wheels hardly move the robot. If you mean "
            "rotations, write on_for_rotations, or %(degrees)g degrees",
            name=call.name,
            amount=amount,
            degrees=360 * amount,
        )
    return ""


def hint_about_distances(clues: Clues) -> Iterator[str]:
    """Yield a hint on a robot that a distance threshold in centimetres stopped in the wrong place."""
    if not any(isinstance(each, STOPPING_CRITERIA) for each in clues.lost):
        return
    comparisons = [
        (listing, each, number)
        for listing, each in collect_statements(clues)
        if (number := _find_compared_number(listing, each, "distance_centimeters")) is not None
    ]
    for listing, statement, number in comparisons[-1:]:
        if number < 10:
            continue
        failed_result = next(
            (criterion for criterion in clues.results if criterion.evidence and not criterion.marks), None
        )
        failure_message = (
            next((one.message for one in failed_result.evidence if not one.passed), "")
            if failed_result is not None
            else ""
        )
        missing_way = measure_missing_way(clues)
        if missing_way is not None and 0 < missing_way < 10 * number:
            yield Sentence(
                "%(place)s compares distance_centimeters with %(number)g centimetres, and the robot stopped "
                "%(distance).0f mm too early. Go on until about %(right).2g",
                place=listing.locate(statement.line),
                number=number,
                distance=missing_way,
                right=number - missing_way / 10,
            )
            return
        explanation = Sentence(
            "%(place)s compares distance_centimeters with %(number)g: that is in centimetres, so %(millimetres)g mm. "
            "For %(number)g mm write %(right)g",
            place=listing.locate(statement.line),
            number=number,
            millimetres=10 * number,
            right=number / 10,
        )
        yield (
            Sentence("%(hint)s. %(failure)s", hint=explanation, failure=failure_message)
            if failure_message
            else explanation
        )


def measure_missing_way(clues: Clues) -> float | None:
    """Return how far ahead of the robot's end the middle of the required zone is, in mm; None if it is not ahead."""
    for criterion in clues.lost:
        if not isinstance(criterion, EndPose) or criterion.zone is None or not clues.recordings:
            continue
        left, bottom, right, top = criterion.zone
        end = clues.recordings[0].end
        if left <= end.x <= right and bottom <= end.y <= top:
            return None
        ahead, side = to_relative_position(end, (left + right) / 2, (bottom + top) / 2)
        return ahead if ahead > 0 and abs(side) < (top - bottom + right - left) / 2 else None
    return None


def hint_about_turns(clues: Clues) -> Iterator[str]:
    """Yield a hint on the only line that turns the robot, if the robot turned too much or too little."""
    turns = list(_collect_turning_calls(clues))
    if len(turns) != 1:
        return
    listing, statement, call = turns[0]
    amount = listing.code.number(call.arguments[-1]) if call.arguments else None
    for criterion in clues.lost:
        required_turn, other_turn = _find_required_turn(criterion), clues.find_finding(criterion, OtherTurn)
        degrees = round(other_turn.degrees, 1) if other_turn else 0.0
        if required_turn is None or amount is None or not degrees:
            continue
        if listing.code.list_enclosing_loops(statement) and not isinstance(criterion, Drawing):
            continue
        middle = abs(sum(required_turn) / 2)
        yield Sentence(
            "%(place)s: the robot turned %(degrees).1f°; expected %(least)g to %(most)g°. Change %(amount)g to "
            "about %(right)s",
            place=listing.locate(statement.line),
            degrees=degrees,
            least=required_turn[0],
            most=required_turn[1],
            amount=amount,
            right=_format_number(amount * middle / degrees),
        )
        return


def _format_number(number: float) -> str:
    return f"{number:.0f}" if abs(number) >= 100 else f"{number:.3g}"


def hint_about_missing_turn(clues: Clues) -> Iterator[str]:
    """Yield a hint on a program that should turn, and only drives with both wheels at the same speed."""
    if not any(_find_required_turn(each) for each in clues.lost) or clues.is_stationary:
        return
    straight_moves = []
    for listing, statement in collect_statements(clues):
        for call in statement.calls:
            method = call.name.rpartition(".")[2]
            if "." not in call.name or method not in LIMITED_MOVES | CONTINUOUS_MOVES:
                continue
            if not call.name.startswith("tank_drive.") or call.arguments[0:1] != call.arguments[1:2]:
                return
            straight_moves.append((listing, statement, call))
    if len(straight_moves) > 1:
        listing, statement, call = straight_moves[-1]
        yield Sentence(
            "%(place)s drives straight on: both wheels have the same speed, and no line turns the robot. To "
            "turn on the spot, write tank_turn.on_for_rotations(-100, 20, %(rotations)s)",
            place=listing.locate(statement.line),
            rotations=join_tokens(call.arguments[-1]),
        )


def hint_about_curves(clues: Clues) -> Iterator[str]:
    """Yield a hint on a turn that is a curve instead of on the spot, if corners are required."""
    corners = any(isinstance(each, Drawing) for each in clues.lost) and not clues.is_stationary
    for listing, statement, call in _collect_turning_calls(clues):
        steering = listing.code.number(call.arguments[0]) if call.arguments else None
        if corners and steering is not None and 0 < abs(steering) < 100:
            spot = 100 if steering > 0 else -100
            yield Sentence(
                "%(place)s steers by %(steering)g, so the robot drives a curve. To turn on the spot, write "
                "%(spot)s instead of %(steering)g",
                place=listing.locate(statement.line),
                steering=steering,
                spot=spot,
            )
            return


def hint_about_speeds(clues: Clues) -> Iterator[str]:
    """Yield a hint on unequal or negative wheel speeds, if the robot should drive straight forwards."""
    if clues.is_stationary or not any(_is_straight_required(criterion) for criterion in clues.lost):
        return
    for listing, statement in collect_statements(clues):
        for call in statement.calls:
            if (
                not call.name.startswith("tank_drive.")
                or call.name.rpartition(".")[2] not in LIMITED_MOVES | CONTINUOUS_MOVES
            ):
                continue
            left_speed, right_speed = (listing.code.number(one) for one in (*call.arguments[:2], (), ())[:2])
            if left_speed is None or right_speed is None or left_speed * right_speed <= 0:
                continue
            if left_speed < 0:
                yield Sentence(
                    "%(place)s drives backwards: the speeds are negative. Write positive speeds",
                    place=listing.locate(statement.line),
                )
                return
            if left_speed != right_speed:
                yield Sentence(
                    "%(place)s gives the wheels the speeds %(left)g and %(right)g, so the robot "
                    "drives a curve. To drive straight on, give both the same speed",
                    place=listing.locate(statement.line),
                    left=left_speed,
                    right=right_speed,
                )
                return


def _is_straight_required(criterion: object) -> bool:
    motions = criterion.moves if isinstance(criterion, Moves) else (criterion,)
    return isinstance(criterion, Moves | Displacement) and all(
        each.forward is not None and each.forward[0] >= 0 and (each.turn is None or each.turn[0] <= 0 <= each.turn[1])
        for each in motions
        if isinstance(each, MotionConditions)
    )


def _collect_turning_calls(clues: Clues) -> Iterator[tuple[Listing, Statement, CallInCode]]:
    """Yield the calls that turn the robot by an amount."""
    for listing, statement in collect_statements(clues):
        for call in statement.calls:
            if call.name.startswith("tank_turn.") and call.name.rpartition(".")[2] in LIMITED_MOVES:
                yield listing, statement, call


def _find_required_turn(criterion: Criterion) -> tuple[float, float] | None:
    if isinstance(criterion, Drawing):
        angles = set(criterion.angle_of_each)
        if len(angles) > 1:
            return None
        angle = angles.pop()
        return angle - criterion.angle_within, angle + criterion.angle_within
    motions = criterion.moves if isinstance(criterion, Moves) else (criterion,)
    ranges = (getattr(each, "turn_size", None) for each in motions)
    return next(((each[0], each[1]) for each in ranges if each is not None), None)


def _is_zero_move(listing: Listing, statement: Statement) -> bool:
    """Return whether the statement drives at speed zero or by zero."""
    for call in statement.calls:
        if call.name.rpartition(".")[2] in CONTINUOUS_MOVES | LIMITED_MOVES:
            speeds = call.arguments[1:2] if "turn" in call.name else call.arguments[:2]
            numbers = [listing.code.number(each) for each in speeds]
            amount = listing.code.number(call.arguments[-1]) if call.arguments else None
            return bool(numbers) and (all(number == 0 for number in numbers) or amount == 0)
    return False


def _find_compared_number(listing: Listing, statement: Statement, reading: str) -> float | None:
    tokens = statement.tokens
    for index, token in enumerate(tokens[:-2]):
        if token == reading and tokens[index + 1] in ("<", ">", "<=", ">="):
            return listing.code.number(tokens[index + 2 : index + 3])
    return None


def _describe_impossible_threshold(listing: Listing, statement: Statement) -> str:
    for reading, (minimum, maximum, _) in READINGS.items():
        number = _find_compared_number(listing, statement, reading)
        if number is not None and not minimum <= number <= maximum:
            return Sentence(
                "%(range)s, so it is never near %(number)g. Choose a number within that range",
                range=describe_reading(reading),
                number=number,
            )
    return ""
