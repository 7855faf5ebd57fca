"""Hints on a reported number that is wrong by a known factor, such as 360 degrees a rotation.

The number comes from what the program printed or said.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterator

from service.grading.hint_clues import Clues, Listing
from service.grading.hint_code import Statement, is_name, join_tokens
from service.grading.hint_differences import describe_factor
from service.grading.hint_loops import describe_reading
from service.grading.hint_structure import collect_statements
from service.grading.hint_tables import OUTPUT_FUNCTIONS
from sim.recording_values import get_recorded_robot
from sim.sentences import Sentence
from submissions.criteria.reporting import Reports

_NUMBER = re.compile(r"-?\d+(?:\.\d+)?")
_RAW_READINGS = frozenset({"red", "green", "blue", "reflected_light_intensity"})
_MAX_PERCENT, _RAW_PER_PERCENT = 100, 2.55
_OPERATORS = frozenset("+-*/")


def hint_about_wrong_scale(clues: Clues) -> Iterator[str]:
    """Yield the line that calculates a number which is wrong by a factor, if the program reports only that number."""
    for criterion in clues.lost:
        rows = criterion.expected if isinstance(criterion, Reports) and criterion.source != "reply" else ()
        if not isinstance(criterion, Reports) or isinstance(rows, str) or len(rows) != 1 or len(rows[0]) != 1:
            continue
        expected = rows[0][0]
        texts = clues.spoken if criterion.source == "speech" else clues.printed
        numbers = {float(each) for text in texts for each in _NUMBER.findall(text)}
        if isinstance(expected, str) or len(numbers) != 1 or expected <= criterion.leeway:
            continue
        number = numbers.pop()
        calculation = _find_calculation(clues)
        if number <= 0 or calculation is None:
            continue
        factors = (expected - criterion.leeway) / number, (expected + criterion.leeway) / number
        advice = describe_factor(*factors) or _describe_wheel_factor(*factors, clues)
        if advice:
            listing, statement = calculation
            yield Sentence(
                "%(place)s, %(code)s: the result is %(number)g. %(advice)s",
                place=listing.locate(statement.line),
                code=join_tokens(statement.tokens),
                number=number,
                advice=advice,
            )
            return


def _describe_wheel_factor(minimum: float, maximum: float, clues: Clues) -> str:
    """Return advice on degrees of the wheels where millimetres are expected; empty for any other number."""
    reads_wheels = any(each.has_token("position") for _, each in collect_statements(clues))
    is_converted = any(each.has_token("pi") or "3.14" in "".join(each.tokens) for _, each in collect_statements(clues))
    recording = next(iter(clues.recordings), None)
    if not reads_wheels or is_converted or recording is None:
        return ""
    diameter = get_recorded_robot(recording).wheel_diameter
    if not minimum <= math.pi * diameter / 360 <= maximum:
        return ""
    return Sentence(
        "It is in degrees of the wheels. For millimetres, write / 360 * math.pi * %(diameter)g behind it, "
        "and import math above",
        diameter=diameter,
    )


def hint_about_raw_report(clues: Clues) -> Iterator[str]:
    """Yield a hint on a reading from 0 to 255 that is reported where percent is expected."""
    for criterion in clues.lost:
        rows = criterion.expected if isinstance(criterion, Reports) and criterion.source != "reply" else ()
        if isinstance(rows, str) or not rows:
            continue
        for trial in clues.shown:
            expected = rows[min(trial.place, len(rows) - 1)][0]
            texts = (line.text for line in (*trial.recording.printed, *trial.recording.spoken))
            numbers = [float(each) for text in texts for each in _NUMBER.findall(text)]
            if isinstance(expected, str) or not 0 < expected <= _MAX_PERCENT or not numbers:
                continue
            statement = _find_raw_output(clues)
            if statement is not None and abs(numbers[0] - expected * _RAW_PER_PERCENT) < 1:
                listing, line, reading = statement
                yield Sentence(
                    "%(place)s writes %(number)g; expected %(expected)g %%. %(range)s. "
                    "Write reflected_light_intensity_pc",
                    place=listing.locate(line),
                    number=numbers[0],
                    expected=expected,
                    range=describe_reading(reading),
                )
                return


def hint_about_colour_number(clues: Clues) -> Iterator[str]:
    """Yield a hint on ``color``, a single number, that is reported where red, green and blue are expected."""
    for criterion in clues.lost:
        rows = criterion.expected if isinstance(criterion, Reports) and criterion.source != "reply" else ()
        if isinstance(rows, str) or not rows or len(rows[0]) != 3 or any(isinstance(each, str) for each in rows[0]):
            continue
        for listing, statement in collect_statements(clues):
            tokens = statement.tokens
            index = next((at for at, token in enumerate(tokens) if token in ("color", "color_name") and at > 1), None)
            is_output = any(call.name in OUTPUT_FUNCTIONS for call in statement.calls) or statement.target
            if index is not None and is_output and tokens[index - 1] == ".":
                yield Sentence(
                    "%(place)s reads %(reading)s, which is one value for the whole colour. Write %(sensor)s.rgb for "
                    "the three numbers of red, green and blue",
                    place=listing.locate(statement.line),
                    reading=tokens[index],
                    sensor=tokens[index - 2],
                )
                return


def _find_raw_output(clues: Clues) -> tuple[Listing, int, str] | None:
    """Return the first output with a reading from 0 to 255."""
    for listing, statement in collect_statements(clues):
        reading = next((token for token in statement.tokens if token in _RAW_READINGS), "")
        if reading and any(call.name in OUTPUT_FUNCTIONS for call in statement.calls):
            return listing, statement.line, reading
    return None


def _find_calculation(clues: Clues) -> tuple[Listing, Statement] | None:
    """Return the only calculation of a name that is printed or said."""
    candidates = []
    for listing, statement in collect_statements(clues):
        if any(call.name in OUTPUT_FUNCTIONS for call in statement.calls):
            names = {token for token in statement.tokens if is_name(token)}
            candidates += [
                (listing, each)
                for each in listing.code.statements
                if each.target in names and _OPERATORS & set(each.tokens)
            ]
    return candidates[0] if len(candidates) == 1 else None
