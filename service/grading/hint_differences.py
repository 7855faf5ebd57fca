"""How a wrong value differs from the expected one, as advice: by one, by a factor, by a missing word."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping, Sequence
from types import MappingProxyType

from responders.message_format import PY
from sim.sentences import Sentence

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
            is_opposite = actual is (not expected)
            return Sentence("Check the condition: it is the opposite of the right one") if is_opposite else ""
        case (int() | float()) as number, (int() | float()) as other if not isinstance(other, bool):
            return _advise_on_numbers(number, other)
        case ((int() | float()), str()):
            return Sentence("It is a text: convert it with int() or float()")
        case str(), (int() | float()):
            return Sentence("It is a number: convert it with str()")
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
        return Sentence("Only the sign is wrong")
    if difference == 1:
        return Sentence("It is 1 too small: check where the count begins and when it is increased, or add 1")
    if difference == -1:
        return Sentence("It is 1 too large: check where the count begins and when it is increased, or subtract 1")
    factor = expected / actual if actual else math.inf
    for ratio in (factor, 1 / factor if factor else math.inf):
        if 1.5 < ratio < 1000.5 and abs(ratio - round(ratio)) < 1e-6 * ratio:
            if ratio == factor:
                return Sentence("It is %(ratio)s times too small: multiply by %(ratio)s", ratio=round(ratio))
            return Sentence("It is %(ratio)s times too large: divide by %(ratio)s", ratio=round(ratio))
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
        return Sentence('The object is written as a whole: take its value with ["%(key)s"]', key=key) if key else ""
    entries = [each.strip(" '\"") for each in match[0][1:-1].split(",")]
    entry = expected[len(start) : len(expected) - len(end)]
    if entry not in entries:
        return ""
    return Sentence("%(list)s is a list: take one entry, [%(index)s]", list=match[0], index=entries.index(entry))


def describe_factor(minimum: float, maximum: float) -> str:
    """Return advice on a value that must be multiplied by a number in this range; empty if that is no known factor."""
    if not 0 < minimum <= maximum < math.inf:
        return ""
    for name, factor in _FACTORS.items():
        if minimum <= factor * _TOLERANCE and factor / _TOLERANCE <= maximum:
            return Sentence("It is %(factor)g times too small: multiply by %(code)s", factor=factor, code=name)
        if minimum <= _TOLERANCE / factor and 1 / (factor * _TOLERANCE) <= maximum:
            return Sentence("It is %(factor)g times too large: divide by %(code)s", factor=factor, code=name)
    return ""


def _advise_on_lists(expected: Sequence[object], actual: Sequence[object]) -> str:
    if any(isinstance(each, list) for each in actual) and not any(isinstance(each, list) for each in expected):
        return Sentence("It contains whole lists: append one value of the list each time")
    if list(actual) == list(reversed(expected)):
        return Sentence("It is in the reverse order")
    if len(actual) < len(expected) and all(each in expected for each in actual):
        return Sentence("Values are missing: check the condition that leaves them out, and where the loop ends")
    if len(actual) > len(expected) and all(each in actual for each in expected):
        return Sentence("It has too many values: check the condition that should leave them out")
    return ""


def _advise_on_texts(expected: str, actual: str) -> str:
    if actual and expected.endswith(actual):
        return Sentence('"%(text)s" is missing at its start', text=expected.removesuffix(actual))
    if actual and expected.startswith(actual):
        return Sentence('"%(text)s" is missing at its end', text=expected.removeprefix(actual))
    if expected and actual.endswith(expected):
        return Sentence('Remove "%(text)s" at its start', text=actual.removesuffix(expected))
    if actual.replace(PY, "", 1) == expected:
        return Sentence('Take %(prefix)s off the message first: text.removeprefix("%(prefix)s")', prefix=PY)
    if actual.casefold() == expected.casefold():
        return Sentence('Only capital and small letters differ: write "%(text)s"', text=expected)
    if _SIGNS.sub("", actual) == _SIGNS.sub("", expected):
        return Sentence('Only signs differ: write "%(text)s"', text=expected)
    entry = _find_list_in_text(expected, actual)
    if entry:
        return entry
    if "".join(actual.split()) == "".join(expected.split()):
        return Sentence("Only blanks differ")
    return ""
