"""How a wrong value differs from the expected one, as advice: by one, by a factor, by a missing word."""

from __future__ import annotations

import math
from collections.abc import Sequence


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
    return ""
