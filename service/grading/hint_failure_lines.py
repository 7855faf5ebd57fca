"""Hints from the line that the program was in when a criterion failed, with what to change there.

The recordings contain the lines that the program came to. The line before a failure is the last motor command, the
loop that ended, or the line that wrote the text.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from service.grading.findings import ExtraText, LateResend, MissingAnswer, OtherMove, OtherSide, StillRunning
from service.grading.grade import Evidence
from service.grading.hint_clues import Clues, F, Listing, name_cell
from service.grading.hint_code import CallInCode, Statement, join_tokens
from service.grading.hint_colours import find_required_colour
from service.grading.hint_conditions import advise_on_leaving
from service.grading.hint_counterfactuals import suggest_number
from service.grading.hint_steering import describe_steering_mistake, describe_turn_from_line
from service.grading.hint_structure import has_motor_call
from service.grading.hint_tables import CONTINUOUS_MOVES, LIMITED_MOVES, PROPERTIES
from service.grading.judging.message_parts import quote_text
from sim.recording import Recording
from sim.sentences import Sentence, join_sentences, make_clause
from submissions.criteria import Criterion
from submissions.criteria.collecting import Collects
from submissions.criteria.ending import EndPose
from submissions.criteria.line import Follows, Laps
from submissions.criteria.motion import Moves
from submissions.criteria.reporting import Reports
from submissions.criteria.stopping import StopOn
from submissions.criteria.unreliable_channel import Resends

_ONE_SENSOR = re.compile(r"\b(left|right) (?:light )?sensor\b", re.IGNORECASE)
_WRITING_FUNCTIONS = frozenset({"print", "say", "speak"})
_SIDES = {"left": "colorLeft", "right": "colorRight"}
_BLOCK_HEADS = frozenset({"if", "elif", "while", "for"})


@dataclass(frozen=True, slots=True)
class _Failure:
    """The failure of a criterion: the recording, its text, and the lines that ran until then, the last one first."""

    criterion: Criterion
    found: str
    recording: Recording
    listing: Listing
    lines: Sequence[Statement]
    task: str
    clues: Clues

    def find_finding(self, kind: type[F]) -> F | None:
        """Return the first finding of this kind about the criterion; None if there is none."""
        return self.clues.find_finding(self.criterion, kind)

    @property
    def message_clause(self) -> str:
        return make_clause(self.found)


def hint_about_failure_line(clues: Clues) -> Iterator[str]:
    """Yield what to change in the line that ran when the criterion that lost most failed."""
    for criterion in clues.costliest_criteria[:2]:
        failure = _find_failure(clues, criterion)
        for rule in (
            _hint_about_duration,
            _hint_about_unwanted_text,
            _hint_about_resending,
            _hint_about_other_sensor,
            _hint_about_crossing,
            _hint_about_loop_end,
            _hint_about_steering,
        ):
            hint = rule(failure) if failure is not None else ""
            if hint:
                yield hint
                return


def hint_about_unentered_loop(clues: Clues) -> Iterator[str]:
    """Yield a hint on a ``while`` loop whose body should have had an effect and was never run."""
    runs = [each for each in clues.recordings if each.places and not each.faults]
    listing = next(iter(clues.programs), None)
    if not clues.lost or listing is None or len(clues.recordings_by_trial) != len(clues.recordings) or not runs:
        return
    executed_lines = {place.line for each in runs for place in each.places if place.outer}
    for statement in listing.code.statements:
        body = listing.code.list_body(statement) if statement.keyword == "while" and not statement.parent >= 0 else ()
        acting_statements = [one for one in body if any(_has_effect(call) for call in one.calls)]
        if acting_statements and not any(one.line in executed_lines for one in body):
            yield Sentence(
                "%(place)s: the loop never ran, because %(condition)s was false from the start. Check the sign of the "
                "comparison and the values in it",
                place=listing.locate(statement.line),
                condition=join_tokens(statement.condition),
            )
            return


def _has_effect(call: CallInCode) -> bool:
    return call.name.rpartition(".")[2] in _WRITING_FUNCTIONS | LIMITED_MOVES | CONTINUOUS_MOVES


def _find_failure(clues: Clues, criterion: Criterion) -> _Failure | None:
    result = next(each for each in clues.results if each.id == criterion.id)
    failed_evidence = next(
        (each for each in result.evidence if not each.passed and each.trial in clues.recordings_by_trial), None
    )
    if failed_evidence is None or not failed_evidence.message:
        return None
    recording = clues.recordings_by_trial[failed_evidence.trial]
    programs = list(clues.programs)
    if criterion.robot == 2 and recording.partner is not None:
        recording, programs = recording.partner, programs[1:] or programs
    if not programs:
        return None
    listing = programs[0] if clues.marked_cell is None else _find_cell(programs, clues.marked_cell)
    return _Failure(
        criterion,
        failed_evidence.message,
        recording,
        listing,
        _list_lines_before(recording, listing, failed_evidence),
        clues.task,
        clues,
    )


def _find_cell(programs: Sequence[Listing], number: int) -> Listing:
    return next((each for each in programs if each.name == name_cell(number)), programs[0])


def _list_lines_before(recording: Recording, listing: Listing, evidence: Evidence) -> list[Statement]:
    """Return the different statements that ran until the failure, the last one first."""
    end_time = recording.end_t if evidence.t is None else evidence.t
    statements: dict[int, Statement] = {}
    for position in reversed(recording.places):
        statement = (
            listing.code.find_statement(position.line) if position.outer and position.t <= end_time + 1e-6 else None
        )
        if statement is not None and statement.line not in statements:
            statements[statement.line] = statement
    return list(statements.values())


def _hint_about_duration(failure: _Failure) -> str:
    """Return a hint on a move that lasted too long or too briefly, with the number of seconds to write."""
    move = failure.find_finding(OtherMove)
    required_moves = failure.criterion.moves if isinstance(failure.criterion, Moves) else ()
    ranges = [each.seconds for each in required_moves if each.seconds]
    move_statement = next((each for each in failure.lines if has_motor_call(each, LIMITED_MOVES)), None)
    if move is None or len(ranges) != 1 or move_statement is None:
        return ""
    minimum, maximum = ranges[0]
    seconds = round(move.seconds, 2)
    if minimum <= seconds <= maximum or not seconds:
        return ""
    call = next(each for each in move_statement.calls if each.name.rpartition(".")[2] in LIMITED_MOVES)
    middle = (minimum + maximum) / 2
    amount = failure.listing.code.number(call.arguments[-1]) if call.arguments else None
    if call.name.endswith("on_for_seconds") and amount:
        fix = suggest_number(amount, amount * middle / seconds)
    elif call.name.endswith("on_for_seconds"):
        fix = Sentence("Write %(seconds)g as the number of seconds", seconds=middle)
    else:
        owner, _, name = call.name.rpartition(".")
        fix = Sentence(
            "%(function)s turns the wheels by an amount, however long that takes. Write %(code)s",
            function=name,
            code=f"{owner}.on_for_seconds(..., {middle:g})",
        )
    return _advise_in_line(failure, move_statement, fix)


def _advise_in_line(failure: _Failure, statement: Statement, advice: str) -> str:
    """Return a hint with the line, the failure and advice."""
    place = failure.listing.locate(statement.line)
    return Sentence("%(place)s: %(problem)s. %(advice)s", place=place, problem=failure.message_clause, advice=advice)


def _hint_about_unwanted_text(failure: _Failure) -> str:
    """Return a hint on a text that is not expected: the line that wrote it, and the condition that led there."""
    extra_text = failure.find_finding(ExtraText)
    statement = next(
        (each for each in failure.lines if any(call.name in _WRITING_FUNCTIONS for call in each.calls)), None
    )
    if extra_text is None or statement is None:
        return ""
    head = next((each for each in failure.listing.code.list_enclosing(statement) if each.keyword in _BLOCK_HEADS), None)
    if head is None:
        fix = Sentence("Remove this line, or write another text")
    elif head.keyword == "for":
        fix = Sentence(
            "Check the values of the loop in line %(line)s: %(code)s",
            line=head.line,
            code=join_tokens(head.tokens[1:]).rstrip(":"),
        )
    else:
        fix = Sentence(
            "Check the condition in line %(line)s: %(condition)s. It must be false then",
            line=head.line,
            condition=join_tokens(head.condition),
        )
    return Sentence(
        "%(place)s writes %(text)s: %(problem)s. %(advice)s",
        place=failure.listing.locate(statement.line),
        text=quote_text(extra_text.text),
        problem=failure.message_clause,
        advice=fix,
    )


def _hint_about_resending(failure: _Failure) -> str:
    """Return a hint on a message that is sent too often or too seldom, with the loop around it."""
    statement = next((each for each in failure.lines if any(call.name == "print" for call in each.calls)), None)
    if not isinstance(failure.criterion, Resends) or statement is None:
        return ""
    loop = next((each for each in failure.listing.code.list_enclosing_loops(statement) if each is not statement), None)
    if failure.find_finding(LateResend) is not None and loop is not None:
        return Sentence(
            "%(place)s sends the message again although its answer had come. %(advice)s",
            place=failure.listing.locate(statement.line),
            advice=advise_on_leaving(failure.listing, loop),
        )
    if failure.find_finding(MissingAnswer) is None:
        return ""
    if loop is None:
        return Sentence(
            "%(place)s sends the message once: %(problem)s. Repeat it in a while loop",
            place=failure.listing.locate(statement.line),
            problem=failure.message_clause,
        )
    loop_head = join_tokens(loop.condition) if loop.keyword == "while" else join_tokens(loop.tokens[1:]).rstrip(":")
    return Sentence(
        "%(place)s: the loop ended, or went on to the next message, before an answer had come. Check %(code)s: it must "
        "send the message again until the answer is there",
        place=failure.listing.locate(loop.line),
        code=loop_head,
    )


def _hint_about_other_sensor(failure: _Failure) -> str:
    """Return a hint on a program that reads only the other light sensor than the one that is judged."""
    side = getattr(failure.criterion, "sensor", "")
    named_sides = {each.lower() for each in _ONE_SENSOR.findall(f"{failure.found} {failure.task}")}
    required_property = _SIDES.get(side) or (_SIDES[named_sides.pop()] if len(named_sides) == 1 else "")
    other_property = "colorRight" if required_property == "colorLeft" else "colorLeft"
    statements = failure.listing.code.statements
    statement = next((each for each in statements if each.has_token(other_property)), None)
    is_output = statement is not None and any(call.name in _WRITING_FUNCTIONS for call in statement.calls)
    # A report with one side's sensor is wrong beside reports with the other's. Other readings may be meant.
    is_mixed = any(each.has_token(required_property) for each in statements) and not (
        is_output and isinstance(failure.criterion, Reports)
    )
    # A program asks for images by a text, whichever sensor it reads.
    is_asked_by_text = isinstance(failure.criterion, Collects)
    if not required_property or statement is None or is_mixed or is_asked_by_text:
        return ""
    return Sentence(
        "%(place)s reads %(other)s, but %(required)s is judged: %(problem)s. Write %(required)s",
        place=failure.listing.locate(statement.line),
        other=other_property,
        required=required_property,
        problem=failure.message_clause,
    )


def _hint_about_crossing(failure: _Failure) -> str:
    """Return a hint on sensors that drive the motors so that the robot turns to the other side than required."""
    statement = next((each for each in failure.lines if any(_is_steering(call) for call in each.calls)), None)
    if statement is None or failure.find_finding(OtherSide) is None:
        return ""
    if not any(each.has_token(*PROPERTIES) for each in failure.listing.code.statements):
        return ""
    return Sentence(
        "%(place)s turns the robot to the other side: %(problem)s. Exchange the values for the left and the right "
        "motor",
        place=failure.listing.locate(statement.line),
        problem=failure.message_clause,
    )


def _hint_about_loop_end(failure: _Failure) -> str:
    """Return a hint on a sensor loop that ended in the wrong place, with the readings there and where it should end."""
    if not isinstance(failure.criterion, StopOn | EndPose):
        return ""
    code = failure.listing.code
    loop_statements = [each for each in failure.lines if _find_sensor_loop(failure.listing, each) is not None]
    loop = next((_find_sensor_loop(failure.listing, each) for each in loop_statements), None)
    if loop is None:
        return ""
    condition = join_tokens(loop.condition)
    last_reading, required_reading = _describe_readings(failure)
    body = code.list_body(loop)
    if failure.find_finding(StillRunning) is not None:
        did_not_end = Sentence("The loop did not end, because %(condition)s stayed true.", condition=condition)
        if required_reading:
            fix = Sentence(
                "At the required place, the sensor reads %(reading)s, and the condition must be false",
                reading=required_reading,
            )
        else:
            fix = Sentence("Choose a condition that becomes false at the required place")
        return _advise_in_line(failure, loop, join_sentences(did_not_end, fix))
    loop_end = Sentence("The loop ends as soon as %(condition)s is false.", condition=condition)
    if any(each.keyword == "break" for each in body):
        loop_end = Sentence("The loop ends.")
    readings: str = ""
    if last_reading and required_reading:
        readings = Sentence(
            "The sensor read %(reading)s; at the required place it reads %(required)s.",
            reading=last_reading,
            required=required_reading,
        )
    elif last_reading:
        readings = Sentence("The sensor read %(reading)s.", reading=last_reading)
    fix = Sentence("Change the condition so that it is true until the robot reaches this place")
    return _advise_in_line(failure, loop, join_sentences(loop_end, readings, fix))


def _find_sensor_loop(listing: Listing, statement: Statement) -> Statement | None:
    """Return the ``while`` loop around a statement that reads a sensor in its condition or body."""
    for candidate in (statement, *listing.code.list_enclosing(statement)):
        body = listing.code.list_body(candidate) if candidate.keyword == "while" else ()
        if candidate.keyword == "while" and any(one.has_token(*PROPERTIES) for one in (candidate, *body)):
            return candidate
    return None


def _describe_readings(failure: _Failure) -> tuple[str, str]:
    """Return what the light sensor read at the end and what it reads in the required place, where known."""
    criterion, recording = failure.criterion, failure.recording
    if not isinstance(criterion, StopOn) or not len(recording.ticks):
        return "", ""
    colours = recording.ticks.right_rgb if criterion.sensor == "right" else recording.ticks.left_rgb
    return _format_colour(colours[-1]), _describe_required_reading(criterion, recording)


def _describe_required_reading(criterion: StopOn, recording: Recording) -> str:
    """Return what the light sensor reads in the required place; empty if unknown."""
    if criterion.rgb is None and criterion.reflected is not None:
        minimum, maximum = criterion.reflected
        if minimum == maximum:
            return f"{minimum:g} %"
        return Sentence("%(least)g to %(most)g %%", least=minimum, most=maximum)
    colour = find_required_colour(criterion, recording)
    return "" if colour is None else _format_colour(colour)


def _format_colour(rgb: Sequence[float]) -> str:
    red, green, blue = (int(each) for each in rgb)
    return f"{100 * red / 255:.1f} %, rgb ({red}, {green}, {blue})"


def _hint_about_steering(failure: _Failure) -> str:
    """Return a hint on a robot that lost the line: the line that steers, and its speed and gain."""
    if not isinstance(failure.criterion, Follows | Laps):
        return ""
    steering_pair = next(((each, call) for each in failure.lines for call in each.calls if _is_steering(call)), None)
    if steering_pair is None:
        return ""
    mistake = describe_steering_mistake(failure.listing, *steering_pair) or describe_turn_from_line(
        failure.listing, *steering_pair, failure.criterion, failure.clues.recordings_by_trial.values()
    )
    if mistake:
        return mistake
    return Sentence(
        "%(place)s steers: %(problem)s. If the robot turns too little, multiply the difference by a larger number or "
        "drive slower; if it turns away from the line, change the sign of the steering",
        place=failure.listing.locate(steering_pair[0].line),
        problem=failure.message_clause,
    )


def _is_steering(call: CallInCode) -> bool:
    return "." in call.name and call.name.rpartition(".")[2] in CONTINUOUS_MOVES
