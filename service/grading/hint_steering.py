"""Mistakes in the line that steers along a line: the same speed for both motors, or an edge of another unit."""

from __future__ import annotations

from service.grading.hint_clues import Listing
from service.grading.hint_code import CallInCode, Statement, join_tokens
from sim.sentences import Sentence

_PERCENT = 100


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
