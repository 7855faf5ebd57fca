"""Parts of messages about motion: reactions, proportions, and how often something happened."""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType

from service.language import translatable
from sim.sentences import Sentence

_REACTIONS: Mapping[str, str] = MappingProxyType(
    {"reverse": translatable("reverse"), "turn": translatable("turn"), "stop": translatable("stop")}
)
_SENSOR_READINGS: Mapping[str, str] = MappingProxyType(
    {
        "left": translatable("the reading of its left light sensor"),
        "right": translatable("the reading of its right light sensor"),
        "either": translatable("the reading of a light sensor"),
    }
)


def describe_reactions(reactions: tuple[str, ...]) -> str:
    """Return the reactions as ``reverse and then turn``."""
    first, *others = reactions
    reaction = Sentence(_REACTIONS[first])
    if not others:
        return reaction
    return Sentence("%(first)s and then %(others)s", first=reaction, others=describe_reactions(tuple(others)))


def describe_reading(light: str) -> str:
    """Return the reading of the "left" or "right" light sensor, or of "either"."""
    return Sentence(_SENSOR_READINGS[light])


def describe_proportion(heights: tuple[float, ...]) -> str:
    """Return the relative lengths of excursions as ``in the proportion 1 to 2 to 1``."""
    if len(set(heights)) == 1:
        return Sentence("equally far each time")
    return Sentence("in the proportion %(heights)s", heights=_join_heights(heights))


def _join_heights(heights: tuple[float, ...]) -> str:
    """Return the heights as ``1 to 2 to 1``."""
    first, *others = heights
    if not others:
        return f"{first:g}"
    return Sentence("%(height)g to %(others)s", height=first, others=_join_heights(tuple(others)))


def format_times(count: int) -> str:
    """Return ``never``, ``once``, ``twice``, ``3 times`` and so on."""
    match count:
        case 0:
            return Sentence("never")
        case 1:
            return Sentence("once")
        case 2:
            return Sentence("twice")
    return Sentence("%(count)s times", count=count)


def describe_repetitions(count: int) -> str:
    """Return how often the robot did as expected: ``did so twice`` or ``never did``."""
    return Sentence("did so %(times)s", times=format_times(count)) if count else Sentence("never did")


def describe_occurrence(number: int) -> str:
    """Return ``the first time``, ``the second time``, ``the third time``, ``the 4th time`` and so on."""
    match number:
        case 1:
            return Sentence("the first time")
        case 2:
            return Sentence("the second time")
        case 3:
            return Sentence("the third time")
    return Sentence("the %(number)sth time", number=number)
