"""Hints on loops that a light sensor ends in the wrong place: a wrong threshold, ``or`` instead of ``and``.

The recordings contain the readings, so the value of the condition can be calculated.
"""

from __future__ import annotations

import operator
from collections.abc import Callable, Iterator, Mapping, Sequence

from service.grading.hint_clues import Clues, Listing
from service.grading.hint_code import CodeStatements, Statement, is_name, join_tokens
from service.grading.hint_structure import collect_statements
from service.grading.judging.geometry import Side, compute_positions
from sim.recording import Floats, Recording
from submissions.criteria.stopping import StopOn

_COMPARISON_FUNCTIONS: Mapping[str, Callable[[float, float], bool]] = {
    "<": operator.lt,
    ">": operator.gt,
    "<=": operator.le,
    ">=": operator.ge,
    "==": operator.eq,
    "!=": operator.ne,
}
_PERCENT = "reflected_light_intensity_pc"
_SENSORS: Mapping[Side, str] = {"left": "colorLeft", "right": "colorRight"}
_CHANNELS = ("red", "green", "blue")
#: The smallest difference of two readings, in percent, that a threshold can separate.
_MIN_DIFFERENCE = 0.5
_Colour = Sequence[float]


def hint_about_thresholds(clues: Clues) -> Iterator[str]:
    """Yield a hint on a loop that continues although the sensor is where the robot should stop."""
    for criterion in clues.lost:
        if not isinstance(criterion, StopOn) or criterion.zone is None or criterion.sensor == "either":
            continue
        for listing, loop in _collect_last_loops(clues):
            found = _find_threshold(listing, loop, _SENSORS[criterion.sensor])
            for recording in clues.recordings if found else ():
                passed = _find_zone_readings(recording, criterion.sensor, criterion.zone)
                if passed is None or found is None:
                    continue
                sign, number = found
                why = _explain_missed_zone(sign, number, *passed)
                if why:
                    yield f"{listing.locate(loop.line)}: {why}"
                    return


def hint_about_joined_colours(clues: Clues) -> Iterator[str]:
    """Yield a hint on ``or`` between colour comparisons where ``and`` is right, or the reverse."""
    for criterion in clues.lost:
        if not isinstance(criterion, StopOn) or criterion.rgb is None:
            continue
        sides = list(_SENSORS) if criterion.sensor == "either" else [criterion.sensor]
        for listing, statement in collect_statements(clues):
            for recording in clues.recordings:
                ends = [_read_end_colour(recording, side) for side in sides if len(recording.ticks)]
                for end in ends:
                    why = _hint_about_wrong_word(listing.code, statement, end, criterion.rgb)
                    if why:
                        yield f"{listing.locate(statement.line)}: {why}"
                        return


def _collect_last_loops(clues: Clues) -> Iterator[tuple[Listing, Statement]]:
    """Yield the last ``while`` loop of each program, which stops the robot."""
    for listing in clues.programs:
        loops = [each for each in listing.code.statements if each.keyword == "while"]
        yield from ((listing, each) for each in loops[-1:])


def _find_threshold(listing: Listing, loop: Statement, sensor: str) -> tuple[str, float] | None:
    """Return the sign and number that the sensor's reading is compared with; None for other conditions."""
    place = next((at for at, token in enumerate(loop.condition) if token in _COMPARISON_FUNCTIONS), None)
    if place is None or any(token in ("and", "or", "not") for token in loop.condition):
        return None
    reading = loop.condition[:place]
    if len(reading) == 1:
        given = [each.tokens[2:] for each in listing.code.statements if each.target == reading[0]]
        reading = given[0] if given and all(each == given[0] for each in given) else ()
    number = listing.code.number(loop.condition[place + 1 :])
    is_this = tuple(reading) == (sensor, ".", _PERCENT) and loop.condition[place] in ("<", ">", "<=", ">=")
    return (loop.condition[place], number) if is_this and number is not None else None


def _find_zone_readings(
    recording: Recording, side: Side, zone: tuple[float, float, float, float]
) -> tuple[Floats, Floats] | None:
    """Return the readings before and in the zone, in percent; None if the robot did not drive through the zone."""
    places = compute_positions(recording, "left_light" if side == "left" else "right_light")[1:]
    left, bottom, right, top = zone
    x, y = places[:, 0], places[:, 1]
    inside = (x >= left) & (x <= right) & (y >= bottom) & (y <= top)
    if not inside.any() or inside[-1] or inside[0]:
        return None
    rgb = recording.ticks.left_rgb if side == "left" else recording.ticks.right_rgb
    reads = 100 * rgb[:, 0].astype(int) / 255
    first = int(inside.argmax())
    return reads[:first], reads[inside]


def _explain_missed_zone(sign: str, number: float, before: Floats, within: Floats) -> str:
    """Return why a loop did not end in the zone, if another threshold would have ended it there; otherwise empty."""
    holds = _COMPARISON_FUNCTIONS[sign]
    if not all(holds(float(each), number) for each in within):
        return ""
    falls = sign in (">", ">=")
    there, earlier = (within.min(), before.min()) if falls else (within.max(), before.max())
    if (earlier - there if falls else there - earlier) < _MIN_DIFFERENCE:
        return ""
    least, most = sorted((float(there), float(earlier)))
    return (
        f"the loop goes on, because the sensor reads {there:.1f} where the robot should stop, and {there:.1f} {sign} "
        f"{number:g} is true. Choose a number between {least:.1f} and {most:.1f}"
    )


def _read_end_colour(recording: Recording, side: Side) -> _Colour:
    rgb = recording.ticks.left_rgb if side == "left" else recording.ticks.right_rgb
    return [float(part) for part in rgb[-1]]


def _hint_about_wrong_word(code: CodeStatements, statement: Statement, end: _Colour, wanted: _Colour) -> str:
    """Return a hint that ``and`` or ``or`` is wrong; empty if the colours don't prove it."""
    pair = _parse_comparison_pair(code, statement)
    if pair is None:
        return ""
    word, comparisons, stops = pair
    ended = [_is_comparison_true(each, end) for each in comparisons]
    meant = [_is_comparison_true(each, wanted) for each in comparisons]
    # With the other word, the loop would have continued here and ended over the required colour.
    if ended[0] == ended[1] or meant != [stops, stops] or (word == "or") != stops:
        return ""
    other = "and" if word == "or" else "or"
    one = comparisons[ended.index(stops)]
    what = f"{one[0]} {one[1]} {one[2]:g}"
    seen = ", ".join(str(int(part)) for part in end)
    because = f"{word} lets {what} alone end it" if stops else f"{word} ends it as soon as {what} is false"
    return f"the loop ended over the colour ({seen}), because {because}. Write {other} in place of {word}"


_Comparison = tuple[str, str, float, int]


def _parse_comparison_pair(code: CodeStatements, statement: Statement) -> tuple[str, list[_Comparison], bool] | None:
    """Return the word between two colour comparisons, the comparisons, and whether the loop ends if they are true."""
    tokens = statement.condition
    if statement.keyword == "while" and tokens[:2] == ("not", "(") and tokens[-1:] == (")",):
        tokens, stops = tokens[2:-1], True
    elif statement.keyword == "while":
        stops = False
    elif statement.keyword == "if" and any(each.keyword == "break" for each in code.list_body(statement)):
        stops = True
    else:
        return None
    words = [at for at, token in enumerate(tokens) if token in ("and", "or", "not")]
    if len(words) != 1 or tokens[words[0]] == "not":
        return None
    found = [_parse_comparison(code, side) for side in (tokens[: words[0]], tokens[words[0] + 1 :])]
    comparisons = [each for each in found if each is not None]
    return (tokens[words[0]], comparisons, stops) if len(comparisons) == 2 else None


def _parse_comparison(code: CodeStatements, tokens: Sequence[str]) -> _Comparison | None:
    """Return the operand, the sign, the number and the colour channel of a comparison; otherwise None."""
    place = next((at for at, token in enumerate(tokens) if token in _COMPARISON_FUNCTIONS), None)
    if place is None:
        return None
    number = code.number(tokens[place + 1 :])
    channel = _find_channel(code, tokens[:place])
    return None if number is None or channel is None else (join_tokens(tokens[:place]), tokens[place], number, channel)


def _find_channel(code: CodeStatements, tokens: Sequence[str]) -> int | None:
    """Return 0 to 2 for red, green and blue, read from the sensor or unpacked from ``rgb``; otherwise None."""
    if not tokens:
        return None
    name = tokens[-1]
    if len(tokens) > 1:
        return _CHANNELS.index(name) if name in _CHANNELS else None
    for each in code.statements:
        if each.tokens[-1:] == ("rgb",) and "=" in each.tokens and len(each.tokens) > 6:
            targets = [token for token in each.tokens[: each.tokens.index("=")] if is_name(token)]
            if name in targets and len(targets) == 3:
                return targets.index(name)
        if each.target == name and each.tokens[-1] in _CHANNELS:
            return _CHANNELS.index(each.tokens[-1])
    return None


def _is_comparison_true(comparison: _Comparison, colour: _Colour) -> bool:
    _, sign, number, channel = comparison
    return _COMPARISON_FUNCTIONS[sign](int(colour[channel]), number)
