"""How a wrong value differs from the expected one, as advice: by one, by a factor, by a missing word."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping, Sequence
from types import MappingProxyType

from responders.message_format import PY

_MAX_CHARACTERS = 20_000
#: Factors between units, as programs write them.
_FACTORS: Mapping[str, float] = MappingProxyType(
    {"math.pi": 3.14159, "10": 10, "25.4": 25.4, "180 / math.pi": 57.2958, "100": 100, "360": 360, "1000": 1000}
)
_TOLERANCE = 1.0001
_LIST = re.compile(r"\[[^\[\]]*\]|\([^()]*,[^()]*\)|\{[^{}]*\}")
_SIGNS = re.compile(r"[^\w\s]")


def advise_on_difference(expected: object, actual: object) -> str:
    """Return what to change, if the two values show it; otherwise empty."""
    match expected, actual:
        case bool(), _:
            return "Check the condition: it is the opposite of the right one" if actual is (not expected) else ""
        case (int() | float()) as number, (int() | float()) as other if not isinstance(other, bool):
            return _advise_on_numbers(number, other)
        case ((int() | float()), str()):
            return "It is a text: convert it with int() or float()"
        case str(), (int() | float()):
            return "It is a number: convert it with str()"
        case list(), list():
            return _advise_on_lists(expected, actual)
        case str(), str():
            return _advise_on_texts(expected, actual)
    return ""


def _advise_on_numbers(expected: float, actual: float) -> str:
    difference = expected - actual
    if not difference:
        return ""
    if actual and expected == -actual:
        return "Only the sign is wrong"
    if abs(difference) == 1:
        size, fix = ("small", "add 1") if difference > 0 else ("large", "subtract 1")
        return f"It is 1 too {size}: check where the count begins and when it is increased, or {fix}"
    factor = expected / actual if actual else math.inf
    for ratio in (factor, 1 / factor if factor else math.inf):
        if 1.5 < ratio < 1000.5 and abs(ratio - round(ratio)) < 1e-6 * ratio:
            size = "small: multiply" if ratio == factor else "large: divide"
            return f"It is {round(ratio)} times too {size} by {round(ratio)}"
    return describe_factor(factor, factor)


def _find_list_in_text(expected: str, actual: str) -> str:
    """Return advice on a text with a whole list where one entry of the list is expected; otherwise empty."""
    match = _LIST.search(actual)
    if match is None:
        return ""
    start, end = actual[: match.start()], actual[match.end() :]
    if not (expected.startswith(start) and expected.endswith(end)):
        return ""
    if match[0].startswith("{"):
        values = re.findall(r"""['"](\w+)['"]: ['"]([^'"]*)['"]""", match[0])
        value = expected[len(start) : len(expected) - len(end)]
        key = next((key for key, found in values if found == value), "")
        return f'The object is written as a whole: take its value with ["{key}"]' if key else ""
    entries = [each.strip(" '\"") for each in match[0][1:-1].split(",")]
    entry = expected[len(start) : len(expected) - len(end)]
    return f"{match[0]} is a list: take one entry, [{entries.index(entry)}]" if entry in entries else ""


def describe_factor(minimum: float, maximum: float) -> str:
    """Return advice on a value that must be multiplied by a number in this range; empty if that is no known factor."""
    if not 0 < minimum <= maximum < math.inf:
        return ""
    for name, factor in _FACTORS.items():
        if minimum <= factor * _TOLERANCE and factor / _TOLERANCE <= maximum:
            return f"It is {factor:g} times too small: multiply by {name}"
        if minimum <= _TOLERANCE / factor and 1 / (factor * _TOLERANCE) <= maximum:
            return f"It is {factor:g} times too large: divide by {name}"
    return ""


def _advise_on_lists(expected: Sequence[object], actual: Sequence[object]) -> str:
    if any(isinstance(each, list) for each in actual) and not any(isinstance(each, list) for each in expected):
        return "It contains whole lists: append one value of the list each time"
    if list(actual) == list(reversed(expected)):
        return "It is in the reverse order"
    if len(actual) < len(expected) and all(each in expected for each in actual):
        return "Values are missing: check the condition that leaves them out, and where the loop ends"
    if len(actual) > len(expected) and all(each in actual for each in expected):
        return "It has too many values: check the condition that should leave them out"
    return ""


def _advise_on_texts(expected: str, actual: str) -> str:
    if actual and expected.endswith(actual):
        return f'"{expected.removesuffix(actual)}" is missing at its start'
    if actual and expected.startswith(actual):
        return f'"{expected.removeprefix(actual)}" is missing at its end'
    if expected and actual.endswith(expected):
        return f'Remove "{actual.removesuffix(expected)}" at its start'
    if actual.replace(PY, "", 1) == expected:
        return f'Take {PY} off the message first: text.removeprefix("{PY}")'
    if actual.casefold() == expected.casefold():
        return f'Only capital and small letters differ: write "{expected}"'
    if _SIGNS.sub("", actual) == _SIGNS.sub("", expected):
        return f'Only signs differ: write "{expected}"'
    entry = _find_list_in_text(expected, actual)
    if entry:
        return entry
    if "".join(actual.split()) == "".join(expected.split()):
        return "Only blanks differ"
    return ""
