"""Hints on formulas: missing brackets, radius instead of diameter, a difference in the wrong order.

A formula is named only if a dependent criterion lost marks, or the recordings show the sign error.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterator, Sequence

import numpy as np

from service.grading.findings import MissingEntry
from service.grading.hint_clues import Clues, Listing, find_listing
from service.grading.hint_code import join_tokens
from service.grading.hint_loops import find_reading
from service.grading.hint_structure import collect_statements
from service.grading.hint_tables import READINGS
from service.language import translatable
from sim.recording import Recording, Verdict
from sim.recording_values import collect_faults
from sim.sentences import Sentence
from submissions.criteria.code import Functions
from submissions.criteria.line import Follows, Laps
from submissions.criteria.reporting import Reports
from submissions.criteria.two_robots import Apart

_DISTANCES = ("distance_centimeters", "distance_inches")
_MIN_BACKWARDS_MM = 20.0
_DIAMETER_NAME = re.compile(r"^d$|diam|wheel|width|across", re.IGNORECASE)
_POSITIVE_NUMBER = re.compile(r"\d+(?:\.\d+)?")
_NUMBER = re.compile(r"-?\d+(?:\.\d+)?")
_HALF_TOLERANCE = 0.05


def hint_about_gain(clues: Clues) -> Iterator[str]:
    """Yield a hint on ``GAIN * light - EDGE``, where brackets around the difference are missing."""
    if not any(isinstance(each, Follows | Laps) for each in clues.lost):
        return
    for listing, statement in collect_statements(clues):
        tokens = statement.tokens
        for index in range(2, len(tokens) - 2):
            gain, times, light, minus, edge = tokens[index - 2 : index + 3]
            if (times, minus) != ("*", "-") or not find_reading((light,), listing.code):
                continue
            factor, offset = listing.code.number((gain,)), listing.code.number((edge,))
            minimum, maximum, _ = READINGS[find_reading((light,), listing.code)]
            if factor and offset is not None and not minimum < offset / factor < maximum:
                template = (
                    translatable(
                        "%(place)s: %(code)s multiplies first, so it is below 0 for each reading. Write %(fixed_code)s"
                    )
                    if factor * maximum <= offset
                    else translatable(
                        "%(place)s: %(code)s multiplies first, so it is above 0 for each reading. Write %(fixed_code)s"
                    )
                )
                yield Sentence(
                    template,
                    place=listing.locate(statement.line),
                    code=join_tokens(tokens[index - 2 : index + 3]),
                    fixed_code=f"{gain} * ({light} - {edge})",
                )
                return


def hint_about_division(clues: Clues) -> Iterator[str]:
    """Yield a hint on ``distance / diameter * math.pi``, where the product should be the divisor."""
    if not any(isinstance(each, Functions | Reports) for each in clues.lost):
        return
    for listing in (*clues.programs, *clues.responders):
        for statement in listing.code.statements:
            tokens = statement.tokens
            for index, token in enumerate(tokens[:-3]):
                name, times = tokens[index + 1 : index + 3]
                is_math_pi = tokens[index + 3 : index + 6] == ("math", ".", "pi")
                if (
                    token == "/"
                    and _DIAMETER_NAME.search(name)
                    and times == "*"
                    and (is_math_pi or tokens[index + 3] == "pi")
                ):
                    circumference = f"{name} * {'math.pi' if is_math_pi else 'pi'}"
                    yield Sentence(
                        "%(place)s divides by %(name)s only, and then multiplies by pi. Put brackets around the "
                        "product: / (%(product)s)",
                        place=listing.locate(statement.line),
                        name=name,
                        product=circumference,
                    )
                    return


def hint_about_radius(clues: Clues) -> Iterator[str]:
    """Yield a hint on a reported length that is half of the expected one, because a radius was used."""
    for criterion in clues.lost:
        missing = clues.find_finding(criterion, MissingEntry)
        if missing is None or not _POSITIVE_NUMBER.fullmatch(missing.entry):
            continue
        reported_numbers = [number for text in missing.texts for number in _NUMBER.findall(text)]
        if len(reported_numbers) != 1 or not float(missing.entry):
            continue
        is_half = abs(float(reported_numbers[0]) / float(missing.entry) - 0.5) < _HALF_TOLERANCE
        for listing, statement in collect_statements(clues) if is_half else ():
            pi_index = next((at for at, token in enumerate(statement.tokens[:-2]) if token == "pi"), None)
            if pi_index is not None and statement.tokens[pi_index + 1] == "*":
                yield Sentence(
                    "%(place)s: the result %(number)s is half of %(expected)s. A wheel's circumference is pi times the "
                    "diameter. If %(name)s is the radius, multiply it by 2",
                    place=listing.locate(statement.line),
                    number=reported_numbers[0],
                    expected=missing.entry,
                    name=statement.tokens[pi_index + 2],
                )
                return


def hint_about_reversed_distance(clues: Clues) -> Iterator[str]:
    """Yield a hint on ``18 - distance`` in a wrong order, if the robot drove backwards."""
    if not any(isinstance(each, Apart) for each in clues.lost) or not any(map(_has_driven_backwards, clues.recordings)):
        return
    for listing, statement in collect_statements(clues):
        for index, token in enumerate(statement.tokens[:-1]):
            if token != "-" or listing.code.number(statement.tokens[index - 1 : index]) is None:
                continue
            reading = _find_distance_reading(listing, statement.tokens[index + 1 :])
            if reading:
                number = statement.tokens[index - 1]
                yield Sentence(
                    "%(place)s: %(number)s - %(reading)s is below 0 when the distance is larger, so the robot drives "
                    "backwards. Write %(reading)s - %(number)s",
                    place=listing.locate(statement.line),
                    number=number,
                    reading=reading,
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
                left_operand = loop.condition[: loop.condition.index(sign)] if sign else ()
                turn_angle = _measure_final_turn(recording)
                if (
                    "angle" not in left_operand
                    or "-" in left_operand[: left_operand.index("angle")]
                    or abs(turn_angle) < 1
                ):
                    continue
                if (turn_angle < 0) == sign.startswith("<"):
                    template = (
                        translatable(
                            "%(place)s: the gyro falls when the robot turns left, so the loop never ends: "
                            "%(condition)s stays true. Write %(fixed_code)s in place of %(code)s"
                        )
                        if turn_angle < 0
                        else translatable(
                            "%(place)s: the gyro grows when the robot turns right, so the loop never ends: "
                            "%(condition)s stays true. Write %(fixed_code)s in place of %(code)s"
                        )
                    )
                    yield Sentence(
                        template,
                        place=listing.locate(loop.line),
                        condition=join_tokens(loop.condition),
                        fixed_code=_swap_operands(left_operand),
                        code=join_tokens(left_operand),
                    )
                    return


def _swap_operands(operand: Sequence[str]) -> str:
    """Return the difference with its operands swapped; the negated value if there is no difference."""
    if "-" in operand:
        minus_index = list(operand).index("-")
        return join_tokens((*operand[minus_index + 1 :], "-", *operand[:minus_index]))
    return f"-{join_tokens(operand)}"


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
