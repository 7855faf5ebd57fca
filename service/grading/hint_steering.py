"""Mistakes in the line that steers along a line: the same speed for both motors, an edge of another unit, a sign.

The first metres of the recorded path show whether the robot turned away from the line.
"""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from service.grading.hint_clues import Listing
from service.grading.hint_code import CallInCode, Statement, is_name, join_tokens
from service.grading.judging.geometry import compute_headings, compute_positions, track_line_progress
from sim.recording import Recording
from sim.sentences import Sentence
from submissions.criteria.line import Follows, Laps

_PERCENT = 100
#: How far a robot that began on the line leaves it, in mm, and in what time before that its turn is measured.
_LEAVING_DISTANCE, _TURN_SECONDS = 10.0, 0.5
_MIN_TURN = 15.0


def describe_steering_mistake(listing: Listing, statement: Statement, call: CallInCode) -> str:
    """Return why a call cannot steer along a line, with the fix; empty if the text does not prove it."""
    place = listing.locate(statement.line)
    if len(call.arguments) == 2 and call.arguments[0] == call.arguments[1] and "+" in call.arguments[0]:
        speed = join_tokens(call.arguments[0])
        return Sentence(
            "%(place)s gives both motors the same speed, %(speed)s, so the robot does not turn. Write - in place of + "
            "for one of them",
            place=place,
            speed=speed,
        )
    return _describe_percent_edge(listing)


def _describe_percent_edge(listing: Listing) -> str:
    """Return a hint on raw light, 0 to 255, from which a number up to 100 is subtracted."""
    statements = listing.code.statements
    raw_names = {each.target for each in statements if each.target and each.tokens[-1] == "reflected_light_intensity"}
    for statement in statements:
        tokens = statement.tokens
        for left, sign, right in zip(tokens, tokens[1:], tokens[2:], strict=False):
            name, number = (left, right) if left in raw_names else (right, left)
            edge = listing.code.number((number,)) if sign == "-" and name in raw_names else None
            if edge is None or not 0 < edge < _PERCENT or any(each.has_token("/") for each in statements):
                continue
            reading = next(each for each in statements if each.target == name)
            return Sentence(
                "%(place)s reads reflected_light_intensity, which goes from 0 to 255, and line %(line)s subtracts "
                "%(edge)g. If %(edge)g is in percent, write reflected_light_intensity_pc",
                place=listing.locate(reading.line),
                line=statement.line,
                edge=edge,
            )
    return ""


def describe_turn_from_line(
    listing: Listing, statement: Statement, call: CallInCode, criterion: Follows | Laps, recordings: Iterable[Recording]
) -> str:
    """Return the fix if the robot turned away from the line, or turned to it too slowly; empty if that is not clear."""
    turns = [turn for each in recordings if (turn := _measure_leaving_turn(criterion, each)) is not None]
    if turns and min(turns) > _MIN_TURN:
        difference = _find_difference(listing, call)
        if difference is None and all(listing.code.number(each) is not None for each in call.arguments):
            return ""  # constant speeds have no sign to change; the branches around them decide
        if difference is None:
            return Sentence(
                "%(place)s turns the robot away from the line as soon as it leaves it. Change the sign of the steering",
                place=listing.locate(statement.line),
            )
        line, first, second = difference
        return Sentence(
            "%(place)s has the wrong sign, so the robot turns away from the line. Write %(second)s - "
            "%(first)s in place of %(first)s - %(second)s",
            place=listing.locate(line),
            first=first,
            second=second,
        )
    if turns and max(turns) <= 0:
        return Sentence(
            "%(place)s turns the robot to the line, but too slowly for its speed. Drive slower, or multiply "
            "the difference by a larger number",
            place=listing.locate(statement.line),
        )
    return ""


def _measure_leaving_turn(criterion: Follows | Laps, recording: Recording) -> float | None:
    """Return by how many degrees a robot turned away from the line while it left it; None if it began elsewhere."""
    part = criterion.of if isinstance(criterion, Follows) else "robot"
    points = compute_positions(recording, part)
    progress = track_line_progress(criterion.line, points, criterion.within)
    if progress is None or progress.first > 0:
        return None
    offsets = progress.offset
    left_rows = np.flatnonzero(np.abs(offsets) > abs(float(offsets[0])) + _LEAVING_DISTANCE)
    if not len(left_rows):
        return None
    row, count = int(left_rows[0]), round(_TURN_SECONDS * recording.ticks.per_second)
    headings = compute_headings(recording)
    turn = float(headings[row] - headings[max(row - count, 0)])
    return turn if offsets[row] > 0 else -turn


def _find_difference(listing: Listing, call: CallInCode) -> tuple[int, str, str] | None:
    """Return the line and the names of the only difference that the steering comes from."""
    names = {token for each in call.arguments for token in each if is_name(token)}
    for statement in listing.code.statements:
        if statement.target not in names or not statement.parent >= 0:
            continue
        tokens = statement.tokens
        signs = [index for index, token in enumerate(tokens) if token == "-"]
        if len(signs) == 1 and signs[0] + 1 < len(tokens):
            first, second = tokens[signs[0] - 1], tokens[signs[0] + 1]
            if is_name(first) and is_name(second) and tokens[signs[0] - 2] in ("(", "="):
                return statement.line, first, second
    return None
