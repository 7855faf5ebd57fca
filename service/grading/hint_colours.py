"""Hints from what the light sensors read at the start and in the required place.

A condition on light is compared with these readings, so that the advice can state them.
"""

from __future__ import annotations

import operator
from collections.abc import Callable, Iterator, Mapping, Sequence
from types import MappingProxyType

from service.grading.hint_clues import Clues
from service.grading.hint_code import CodeStatements, Statement, is_name, join_tokens
from service.grading.hint_structure import collect_statements, has_motor_call
from service.grading.hint_tables import CONTINUOUS_MOVES, LIMITED_MOVES, OPPOSITE_SIGNS
from service.grading.judging.geometry import compute_positions
from sim.recording import Recording
from sim.recording_values import rebuild_floor
from sim.sentences import Sentence
from submissions.criteria.stopping import StopOn

_SIDES = frozenset({"colorLeft", "colorRight"})
_CHANNELS = ("red", "green", "blue")
_COMPARISONS: Mapping[str, Callable[[float, float], bool]] = MappingProxyType(
    {"<": operator.lt, "<=": operator.le, ">": operator.gt, ">=": operator.ge}
)
_SHORT_RUN_SECONDS = 0.5
#: Values of a colour that are as near as this count as the same, from 0 to 255.
_SAME_VALUE, _OTHER_VALUE = 40, 100
Colour = tuple[float, float, float]


def hint_about_opposite_condition(clues: Clues) -> Iterator[str]:
    """Yield a hint on a robot that never moved because its loop asks for the opposite of the light at the start."""
    recording = next(iter(clues.recordings), None)
    if recording is None or not (clues.is_stationary or clues.seconds <= _SHORT_RUN_SECONDS):
        return
    criterion = next((each for each in clues.lost if isinstance(each, StopOn)), None)
    required = None if criterion is None else find_required_colour(criterion, recording)
    for listing, statement in collect_statements(clues):
        is_start = statement.keyword == "while" and statement.parent < 0
        body = listing.code.list_body(statement) if is_start else ()
        earlier = listing.code.statements[: statement.number]
        if not any(has_motor_call(each, CONTINUOUS_MOVES | LIMITED_MOVES) for each in (*earlier, *body)) or not body:
            continue
        comparisons = list(_split_comparisons(statement.condition))
        sources = [_find_source(listing.code, left) for left, _, _ in comparisons]
        limits = [listing.code.number(right) for _, _, right in comparisons]
        opposite_signs = [OPPOSITE_SIGNS.get(sign, "") for _, sign, _ in comparisons]
        known = [
            (source, sign, limit)
            for source, sign, limit in zip(sources, opposite_signs, limits, strict=True)
            if source is not None and limit is not None and sign
        ]
        starts = [_convert_colour(_read_start(recording, sensor), reading) for (sensor, reading), _, _ in known]
        if not known or len(known) < len(comparisons) or not _are_all_true(starts, known):
            return
        # A loop whose opposite is true in the required place as well would not end there.
        if _are_all_true([_convert_colour(required, reading) for (_, reading), _, _ in known], known):
            return
        first = join_tokens(comparisons[0][0])
        yield Sentence(
            "%(place)s: the loop never runs, because %(condition)s is false from the start: %(name)s is about "
            "%(reading).0f there. Write %(opposite)s",
            place=listing.locate(statement.line),
            condition=join_tokens(statement.condition),
            name=first,
            reading=starts[0],
            opposite=join_tokens([OPPOSITE_SIGNS.get(token, token) for token in statement.condition]),
        )
        return


def hint_about_shared_colour(clues: Clues) -> Iterator[str]:
    """Yield a hint on a loop that ends at once, because the floor has as much of a colour as the required place."""
    recording = next(iter(clues.recordings), None)
    criterion = next((each for each in clues.lost if isinstance(each, StopOn)), None)
    if recording is None or criterion is None or clues.seconds > _SHORT_RUN_SECONDS:
        return
    required = find_required_colour(criterion, recording)
    for listing, statement in collect_statements(clues):
        condition = statement.condition[1:] if statement.condition[:1] == ("not",) else statement.condition
        comparisons = list(_split_comparisons(condition)) if statement.keyword == "while" else []
        source = _find_source(listing.code, comparisons[0][0]) if len(comparisons) == 1 else None
        if required is None or source is None or source[1] not in _CHANNELS:
            continue
        start = _read_start(recording, source[0])
        if start is None:
            continue
        channel = _CHANNELS.index(source[1])
        differences = [abs(first - second) for first, second in zip(start, required, strict=True)]
        best = max(range(len(_CHANNELS)), key=lambda each: differences[each])
        if differences[channel] > _SAME_VALUE or differences[best] < _OTHER_VALUE:
            continue
        yield Sentence(
            "%(place)s: the loop ends at once, because %(name)s is %(start).0f at the start. Ask for "
            "%(other)s, too: %(other_start).0f there, %(other_required).0f in the required place",
            place=listing.locate(statement.line),
            name=_CHANNELS[channel],
            start=start[channel],
            other=_CHANNELS[best],
            other_start=start[best],
            other_required=required[best],
        )
        return


def find_required_colour(criterion: StopOn, recording: Recording) -> Colour | None:
    """Return the colour of the floor in the middle of the required place; None if unknown."""
    if criterion.rgb is not None:
        red, green, blue = criterion.rgb
        return float(red), float(green), float(blue)
    position = criterion.near
    if criterion.zone is not None:
        left, bottom, right, top = criterion.zone
        position = (left + right) / 2, min(max(recording.end.y, bottom), top)
    return None if position is None else _read_floor(recording, *position)


def _read_floor(recording: Recording, x: float, y: float) -> Colour | None:
    """Return the colour of a point of the floor; None beside it, and for an unknown floor."""
    floor = rebuild_floor(recording)
    if floor is None:
        return None
    height, width = floor.pixels.shape[:2]
    column, row = round(x), height - 1 - round(y)
    # A place may lie beside the floor, and a robot may end there.
    if not (0 <= column < width and 0 <= row < height):
        return None
    red, green, blue = (float(each) for each in floor.pixels[row, column][:3])
    return red, green, blue


def _split_comparisons(condition: Sequence[str]) -> Iterator[tuple[tuple[str, ...], str, tuple[str, ...]]]:
    """Yield operand, sign and number of each comparison that ``and`` joins. The sign is empty for anything else."""
    parts: list[list[str]] = [[]]
    for token in condition:
        if token == "and":
            parts.append([])
        else:
            parts[-1].append(token)
    for part in parts:
        signs = [index for index, token in enumerate(part) if token in _COMPARISONS]
        if len(signs) == 1 and "or" not in part:
            yield tuple(part[: signs[0]]), part[signs[0]], tuple(part[signs[0] + 1 :])
        else:
            yield tuple(part), "", ()


def _convert_colour(colour: Colour | None, reading: str) -> float | None:
    """Return what a light sensor gives as this reading above a colour; None for an unknown colour or reading."""
    if colour is None:
        return None
    if reading in _CHANNELS:
        return colour[_CHANNELS.index(reading)]
    scale = {"reflected_light_intensity_pc": 100 / 255, "reflected_light_intensity": 1.0}.get(reading)
    return None if scale is None else colour[0] * scale


def _are_all_true(values: Sequence[float | None], comparisons: Sequence[tuple[object, str, float]]) -> bool:
    """Return whether each value is known and passes the comparison with its sign and limit."""
    pairs = zip(values, comparisons, strict=True)
    return all(value is not None and _COMPARISONS[sign](value, limit) for value, (_, sign, limit) in pairs)


def _find_source(code: CodeStatements, tokens: Sequence[str]) -> tuple[str, str] | None:
    """Return the sensor and the reading that an operand is or was assigned; None for anything else."""
    if len(tokens) == 3 and tokens[0] in _SIDES and tokens[1] == ".":
        return tokens[0], tokens[2]
    if len(tokens) != 1 or not is_name(tokens[0]):
        return None
    for statement in code.statements:
        targets = _list_targets(statement)
        if tokens[0] not in targets or statement.tokens[-3:-2] == () or statement.tokens[-3] not in _SIDES:
            continue
        reading = statement.tokens[-1]
        if len(targets) == 1:
            return statement.tokens[-3], reading
        if reading == "rgb" and len(targets) == len(_CHANNELS):
            return statement.tokens[-3], _CHANNELS[targets.index(tokens[0])]
    return None


def _list_targets(statement: Statement) -> list[str]:
    """Return the names to the left of the only ``=``."""
    tokens = statement.tokens
    return [each for each in tokens[: tokens.index("=")] if is_name(each)] if tokens.count("=") == 1 else []


def _read_start(recording: Recording, sensor: str) -> Colour | None:
    """Return the colour under the middle of a light sensor at the start."""
    x, y = compute_positions(recording, "right_light" if sensor == "colorRight" else "left_light")[0]
    return _read_floor(recording, float(x), float(y))
