"""Other values for the numbers of a submission's parts, the likely ones first."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence

from service.grading.hint_counterfactuals import find_scaled_line
from service.grading.number_roles import describe_direction, find_direction
from service.grading.program_numbers import (
    Candidate,
    ProgramNumber,
    collect_numbers,
    suggest_other_speeds,
    suggest_rotations,
    suggest_scaled_numbers,
    suggest_thresholds,
)
from service.grading.reruns.engine import RerunEngine
from service.grading.reruns.exchanges import ChangedLine, PartName, RecordedLines, get_part_file
from service.mutation.source_tree import SourceTree
from sim.sentences import Sentence

#: Sizes of the changes, as logarithms of the factor: wide steps first, then those between them.
_SIZES = (0.4, 0.8, 0.2, 1.2, 0.1, 1.7, 0.05, 2.3)
_WHOLE_STEPS = (1, 2, 3, 5)
_ZERO_VALUES = (1.0, -1.0, 10.0, 0.5)
#: Numbers are left out if this many values change no recording.
_MAX_TRIES_WITHOUT_EFFECT = 2
#: The path of more trials is not predicted.
_MAX_PREDICTED_TRIALS = 2


def list_number_changes(
    engine: RerunEngine,
    criterion: str,
    trees: Mapping[PartName, SourceTree],
    has_effect: Callable[[ChangedLine], bool],
) -> Iterator[ChangedLine]:
    """Yield the numbers of all parts with other values. ``has_effect`` is asked about the last one before the next.

    Raises the same errors as ``RerunEngine.rerun``.
    """
    parts = {get_part_file(part): part for part in trees}
    numbers = collect_numbers({get_part_file(part): tree for part, tree in trees.items()})
    tries_without_effect = Counter[int]()
    for number, value in _list_candidates(engine, criterion, trees, numbers):
        if tries_without_effect[number.index] >= _MAX_TRIES_WITHOUT_EFFECT:
            continue
        change = _change_number(parts[number.file], number, value)
        yield change
        tries_without_effect[number.index] += not has_effect(change)


def _list_candidates(
    engine: RerunEngine, criterion: str, trees: Mapping[PartName, SourceTree], numbers: Sequence[ProgramNumber]
) -> Iterator[Candidate]:
    """Yield the values that the path and the world suggest, then the grid."""
    if "program" in trees:
        yield from suggest_scaled_numbers(numbers, _predict_scaled_line(engine, criterion, trees["program"].text))
    yield from suggest_other_speeds(numbers)
    yield from suggest_rotations(numbers, engine.robot)
    yield from suggest_thresholds(numbers, engine.floor)
    for number in numbers:
        if number.value and not number.is_whole:
            yield number, -number.value
    for level in range(len(_SIZES)):
        for number in numbers:
            yield from ((number, value) for value in _list_values(number, level))


def _list_values(number: ProgramNumber, level: int) -> Iterator[float]:
    if not number.value or number.is_whole:
        steps = [sign * step for step in _WHOLE_STEPS for sign in (1, -1)] if number.is_whole else _ZERO_VALUES
        yield from (number.value + step for step in steps[2 * level : 2 * level + 2])
    else:
        yield from (number.value * math.exp(sign * _SIZES[level]) for sign in (1, -1))


def _predict_scaled_line(engine: RerunEngine, criterion: str, program: str) -> tuple[int, float] | None:
    trials = engine.list_trials(criterion)
    if len(trials) > _MAX_PREDICTED_TRIALS:
        return None
    rerun = engine.rerun(trials, (RecordedLines(),))
    results = [engine.build_result(index, rerun.recordings[index]) for index in trials]
    schema = next(each for each in engine.assignment.criteria if each.id == criterion)
    return find_scaled_line(program, engine.assignment, schema, results)


def _change_number(part: PartName, number: ProgramNumber, value: float) -> ChangedLine:
    new = number.format_value(value)
    place = Sentence("line %(line)s of %(name)s", line=number.line, name=number.file)
    direction = find_direction(number.value, float(new), number.role)
    return ChangedLine(
        part,
        number.line,
        number.old,
        new,
        number.change_text(value),
        direction=describe_direction(number.role, direction, place),
    )
