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
from service.grading.judging.message_parts import add_place
from service.language import translatable
from sim.recording import Floats, Recording
from sim.sentences import Sentence
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
            threshold = _find_threshold(listing, loop, _SENSORS[criterion.sensor])
            for recording in clues.recordings if threshold else ():
                readings = _find_zone_readings(recording, criterion.sensor, criterion.zone)
                if readings is None or threshold is None:
                    continue
                sign, number = threshold
                explanation = _explain_missed_zone(sign, number, *readings)
                if explanation:
                    yield add_place(listing.locate(loop.line), explanation)
                    return


def hint_about_joined_colours(clues: Clues) -> Iterator[str]:
    """Yield a hint on ``or`` between colour comparisons where ``and`` is right, or the reverse."""
    for criterion in clues.lost:
        if not isinstance(criterion, StopOn) or criterion.rgb is None:
            continue
        sides = list(_SENSORS) if criterion.sensor == "either" else [criterion.sensor]
        for listing, statement in collect_statements(clues):
            for recording in clues.recordings:
                end_colours = [_read_end_colour(recording, side) for side in sides if len(recording.ticks)]
                for end_colour in end_colours:
                    explanation = _hint_about_wrong_word(listing.code, statement, end_colour, criterion.rgb)
                    if explanation:
                        yield add_place(listing.locate(statement.line), explanation)
                        return


def _collect_last_loops(clues: Clues) -> Iterator[tuple[Listing, Statement]]:
    """Yield the last ``while`` loop of each program, which stops the robot."""
    for listing in clues.programs:
        loops = [each for each in listing.code.statements if each.keyword == "while"]
        yield from ((listing, each) for each in loops[-1:])


def _find_threshold(listing: Listing, loop: Statement, sensor: str) -> tuple[str, float] | None:
    """Return the sign and number that the sensor's reading is compared with; None for other conditions."""
    sign_index = next((at for at, token in enumerate(loop.condition) if token in _COMPARISON_FUNCTIONS), None)
    if sign_index is None or any(token in ("and", "or", "not") for token in loop.condition):
        return None
    reading = loop.condition[:sign_index]
    if len(reading) == 1:
        values = [each.tokens[2:] for each in listing.code.statements if each.target == reading[0]]
        reading = values[0] if values and all(each == values[0] for each in values) else ()
    number = listing.code.number(loop.condition[sign_index + 1 :])
    is_this = tuple(reading) == (sensor, ".", _PERCENT) and loop.condition[sign_index] in ("<", ">", "<=", ">=")
    return (loop.condition[sign_index], number) if is_this and number is not None else None


def _find_zone_readings(
    recording: Recording, side: Side, zone: tuple[float, float, float, float]
) -> tuple[Floats, Floats] | None:
    """Return the readings before and in the zone, in percent; None if the robot did not drive through the zone."""
    positions = compute_positions(recording, "left_light" if side == "left" else "right_light")[1:]
    left, bottom, right, top = zone
    x, y = positions[:, 0], positions[:, 1]
    is_inside = (x >= left) & (x <= right) & (y >= bottom) & (y <= top)
    if not is_inside.any() or is_inside[-1] or is_inside[0]:
        return None
    rgb = recording.ticks.left_rgb if side == "left" else recording.ticks.right_rgb
    percentages = 100 * rgb[:, 0].astype(int) / 255
    first_index = int(is_inside.argmax())
    return percentages[:first_index], percentages[is_inside]


def _explain_missed_zone(sign: str, number: float, readings_before: Floats, zone_readings: Floats) -> str:
    """Return why a loop did not end in the zone, if another threshold would have ended it there; otherwise empty."""
    compare = _COMPARISON_FUNCTIONS[sign]
    if not all(compare(float(each), number) for each in zone_readings):
        return ""
    is_falling = sign in (">", ">=")
    zone_extreme, earlier_extreme = (
        (zone_readings.min(), readings_before.min()) if is_falling else (zone_readings.max(), readings_before.max())
    )
    if (earlier_extreme - zone_extreme if is_falling else zone_extreme - earlier_extreme) < _MIN_DIFFERENCE:
        return ""
    minimum, maximum = sorted((float(zone_extreme), float(earlier_extreme)))
    return Sentence(
        "the loop continues, because the sensor reads %(reading).1f where the robot should stop, and "
        "%(reading).1f %(sign)s %(number)g is true. Choose a number between %(minimum).1f and %(maximum).1f",
        reading=float(zone_extreme),
        sign=sign,
        number=number,
        minimum=minimum,
        maximum=maximum,
    )


def _read_end_colour(recording: Recording, side: Side) -> _Colour:
    rgb = recording.ticks.left_rgb if side == "left" else recording.ticks.right_rgb
    return [float(part) for part in rgb[-1]]


def _hint_about_wrong_word(code: CodeStatements, statement: Statement, end: _Colour, expected: _Colour) -> str:
    """Return a hint that ``and`` or ``or`` is wrong; empty if the colours don't prove it."""
    pair = _parse_comparison_pair(code, statement)
    if pair is None:
        return ""
    word, comparisons, is_stop = pair
    end_results = [_is_comparison_true(each, end) for each in comparisons]
    expected_results = [_is_comparison_true(each, expected) for each in comparisons]
    # With the other word, the loop would have continued here and ended over the required colour.
    if end_results[0] == end_results[1] or expected_results != [is_stop, is_stop] or (word == "or") != is_stop:
        return ""
    other_word = "and" if word == "or" else "or"
    decisive_comparison = comparisons[end_results.index(is_stop)]
    comparison_text = f"{decisive_comparison[0]} {decisive_comparison[1]} {decisive_comparison[2]:g}"
    colour_text = ", ".join(str(int(part)) for part in end)
    template = (
        translatable(
            "the loop ended over the colour (%(colour)s), because %(word)s lets %(comparison)s alone end it. Write "
            "%(right)s instead of %(word)s"
        )
        if is_stop
        else translatable(
            "the loop ended over the colour (%(colour)s), because %(word)s ends it as soon as %(comparison)s is false. "
            "Write %(right)s instead of %(word)s"
        )
    )
    return Sentence(template, colour=colour_text, word=word, comparison=comparison_text, right=other_word)


_Comparison = tuple[str, str, float, int]


def _parse_comparison_pair(code: CodeStatements, statement: Statement) -> tuple[str, list[_Comparison], bool] | None:
    """Return the word between two colour comparisons, the comparisons, and whether the loop ends if they are true."""
    tokens = statement.condition
    if statement.keyword == "while" and tokens[:2] == ("not", "(") and tokens[-1:] == (")",):
        tokens, is_stop = tokens[2:-1], True
    elif statement.keyword == "while":
        is_stop = False
    elif statement.keyword == "if" and any(each.keyword == "break" for each in code.list_body(statement)):
        is_stop = True
    else:
        return None
    word_indices = [at for at, token in enumerate(tokens) if token in ("and", "or", "not")]
    if len(word_indices) != 1 or tokens[word_indices[0]] == "not":
        return None
    parsed_sides = [
        _parse_comparison(code, side) for side in (tokens[: word_indices[0]], tokens[word_indices[0] + 1 :])
    ]
    comparisons = [each for each in parsed_sides if each is not None]
    return (tokens[word_indices[0]], comparisons, is_stop) if len(comparisons) == 2 else None


def _parse_comparison(code: CodeStatements, tokens: Sequence[str]) -> _Comparison | None:
    """Return the operand, the sign, the number and the colour channel of a comparison; otherwise None."""
    sign_index = next((at for at, token in enumerate(tokens) if token in _COMPARISON_FUNCTIONS), None)
    if sign_index is None:
        return None
    number = code.number(tokens[sign_index + 1 :])
    channel = _find_channel(code, tokens[:sign_index])
    return (
        None
        if number is None or channel is None
        else (join_tokens(tokens[:sign_index]), tokens[sign_index], number, channel)
    )


def _find_channel(code: CodeStatements, tokens: Sequence[str]) -> int | None:
    """Return 0 to 2 for red, green and blue, read from the sensor or unpacked from ``rgb``; otherwise None."""
    if not tokens:
        return None
    name = tokens[-1]
    if len(tokens) > 1:
        return _CHANNELS.index(name) if name in _CHANNELS else None
    for statement in code.statements:
        if statement.tokens[-1:] == ("rgb",) and "=" in statement.tokens and len(statement.tokens) > 6:
            targets = [token for token in statement.tokens[: statement.tokens.index("=")] if is_name(token)]
            if name in targets and len(targets) == 3:
                return targets.index(name)
        if statement.target == name and statement.tokens[-1] in _CHANNELS:
            return _CHANNELS.index(statement.tokens[-1])
    return None


def _is_comparison_true(comparison: _Comparison, colour: _Colour) -> bool:
    _, sign, number, channel = comparison
    return _COMPARISON_FUNCTIONS[sign](int(colour[channel]), number)
