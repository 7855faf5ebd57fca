"""Hints on formulas: missing brackets, radius instead of diameter, a difference in the wrong order.

A formula is named only if a dependent criterion lost marks, or the recordings show the sign error.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterator, Sequence

import numpy as np

from service.grading.hint_clues import Clues, Listing, find_listing
from service.grading.hint_code import join_tokens
from service.grading.hint_loops import find_reading
from service.grading.hint_structure import collect_statements
from service.grading.hint_tables import READINGS
from sim.recording import Recording, Verdict
from sim.recording_values import collect_faults
from submissions.criteria.code import Functions
from submissions.criteria.line import Follows, Laps
from submissions.criteria.reporting import Reports
from submissions.criteria.two_robots import Apart

_DISTANCES = ("distance_centimeters", "distance_inches")
_MIN_BACKWARDS_MM = 20.0
_DIAMETER_NAME = re.compile(r"^d$|diam|wheel|width|across", re.IGNORECASE)
_ASKED_NUMBER = re.compile(r'"(\d+(?:\.\d+)?)" (?:\(within|did not)')
_NUMBER = re.compile(r"-?\d+(?:\.\d+)?")
_HALF_TOLERANCE = 0.05


def hint_about_gain(clues: Clues) -> Iterator[str]:
    """Yield a hint on ``GAIN * light - EDGE``, where brackets around the difference are missing."""
    if not any(isinstance(each, Follows | Laps) for each in clues.lost):
        return
    for listing, each in collect_statements(clues):
        tokens = each.tokens
        for place in range(2, len(tokens) - 2):
            gain, times, light, minus, edge = tokens[place - 2 : place + 3]
            if (times, minus) != ("*", "-") or not find_reading((light,), listing.code):
                continue
            factor, offset = listing.code.number((gain,)), listing.code.number((edge,))
            least, most, _ = READINGS[find_reading((light,), listing.code)]
            if factor and offset is not None and not least < offset / factor < most:
                sign = "below" if factor * most <= offset else "above"
                yield (
                    f"{listing.locate(each.line)}: {join_tokens(tokens[place - 2 : place + 3])} multiplies first, "
                    "so it is "
                    f"{sign} 0 for each reading. Write {gain} * ({light} - {edge})"
                )
                return


def hint_about_division(clues: Clues) -> Iterator[str]:
    """Yield a hint on ``distance / diameter * math.pi``, where the product should be the divisor."""
    if not any(isinstance(each, Functions | Reports) for each in clues.lost):
        return
    for listing in (*clues.programs, *clues.responders):
        for each in listing.code.statements:
            tokens = each.tokens
            for place, token in enumerate(tokens[:-3]):
                name, times = tokens[place + 1 : place + 3]
                pi = tokens[place + 3 : place + 6] == ("math", ".", "pi")
                if token == "/" and _DIAMETER_NAME.search(name) and times == "*" and (pi or tokens[place + 3] == "pi"):
                    circumference = f"{name} * {'math.pi' if pi else 'pi'}"
                    yield (
                        f"{listing.locate(each.line)} divides by {name} only, and then multiplies by pi. "
                        f"Put brackets around the product: / ({circumference})"
                    )
                    return


def hint_about_radius(clues: Clues) -> Iterator[str]:
    """Yield a hint on a reported length that is half of the expected one, because a radius was used."""
    results = [
        each for each in clues.results if any(each.id == one.id for one in clues.lost if isinstance(one, Reports))
    ]
    for result in results:
        asked = _ASKED_NUMBER.search(result.message)
        said = _NUMBER.findall(result.message.rpartition(": ")[2])
        if asked is None or len(said) != 1 or not float(asked[1]):
            continue
        is_half = abs(float(said[0]) / float(asked[1]) - 0.5) < _HALF_TOLERANCE
        for listing, each in collect_statements(clues) if is_half else ():
            place = next((at for at, token in enumerate(each.tokens[:-2]) if token == "pi"), None)
            if place is not None and each.tokens[place + 1] == "*":
                yield (
                    f"{listing.locate(each.line)}: the result {said[0]} is half of {asked[1]}. A wheel's "
                    "circumference is "
                    f"pi times the diameter. If {each.tokens[place + 2]} is the radius, multiply it by 2"
                )
                return


def hint_about_reversed_distance(clues: Clues) -> Iterator[str]:
    """Yield a hint on ``18 - distance`` in a wrong order, if the robot drove backwards."""
    if not any(isinstance(each, Apart) for each in clues.lost) or not any(map(_has_driven_backwards, clues.recordings)):
        return
    for listing, each in collect_statements(clues):
        for place, token in enumerate(each.tokens[:-1]):
            if token != "-" or listing.code.number(each.tokens[place - 1 : place]) is None:
                continue
            reading = _find_distance_reading(listing, each.tokens[place + 1 :])
            if reading:
                number = each.tokens[place - 1]
                yield (
                    f"{listing.locate(each.line)}: {number} - {reading} is below 0 when the distance is larger, so the "
                    f"robot drives backwards. Write {reading} - {number}"
                )
                return


def hint_about_gyro_direction(clues: Clues) -> Iterator[str]:
    """Yield a hint on a loop that waits for the gyro to change in the wrong direction."""
    for recording in clues.recordings:
        for fault in collect_faults(recording)[:1]:
            listing = find_listing(fault, clues)
            statement = listing.code.find_statement(fault.line) if listing is not None else None
            if fault.verdict not in (Verdict.TIME_LIMIT, Verdict.CPU_LIMIT) or listing is None or statement is None:
                continue
            for loop in listing.code.list_enclosing_loops(statement):
                sign = next((token for token in loop.condition if token in ("<", ">", "<=", ">=")), "")
                left = loop.condition[: loop.condition.index(sign)] if sign else ()
                turned = _measure_final_turn(recording)
                if "angle" not in left or "-" in left[: left.index("angle")] or abs(turned) < 1:
                    continue
                if (turned < 0) == sign.startswith("<"):
                    way, side = ("falls", "left") if turned < 0 else ("grows", "right")
                    yield (
                        f"{listing.locate(loop.line)}: the gyro {way} when the robot turns {side}, so the loop "
                        "never ends: "
                        f"{join_tokens(loop.condition)} stays true. Write {_swap_operands(left)} in place of "
                        f"{join_tokens(left)}"
                    )
                    return


def _swap_operands(left: Sequence[str]) -> str:
    """Return the difference with its operands swapped; the negated value if there is no difference."""
    if "-" in left:
        place = list(left).index("-")
        return join_tokens((*left[place + 1 :], "-", *left[:place]))
    return f"-{join_tokens(left)}"


def _find_distance_reading(listing: Listing, tokens: Sequence[str]) -> str:
    """Return the operand as code if it is a distance reading; otherwise empty."""
    if tokens[1:2] == (".",) and tokens[2:3] and tokens[2] in _DISTANCES:
        return join_tokens(tokens[:3])
    return tokens[0] if find_reading(tokens[:1], listing.code) in _DISTANCES else ""


def _measure_final_turn(recording: Recording) -> float:
    """Return the change of the gyro over the last 30 ticks, in degrees."""
    angles = np.asarray(recording.ticks.gyro, dtype=float)
    return float(angles[-1] - angles[max(len(angles) - 30, 0)]) if len(angles) else 0.0


def _has_driven_backwards(recording: Recording) -> bool:
    heading = math.radians(recording.start.heading)
    dx, dy = recording.end.x - recording.start.x, recording.end.y - recording.start.y
    return dx * math.cos(heading) + dy * math.sin(heading) < -_MIN_BACKWARDS_MM
