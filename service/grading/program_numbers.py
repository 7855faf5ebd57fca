"""The numbers in a student's programs, and other values for them that the assignment's world suggests.

``number_search.py`` and ``reruns/changed_numbers.py`` run programs with these values.
"""

from __future__ import annotations

import ast
import itertools
import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from service.grading.number_roles import WHOLE_ROLES, NumberRole, find_lines, find_role
from service.mutation.source_tree import Edit, NumberLiteral, SourceTree
from sim.floors import Floor
from sim.robot import Robot
from submissions.submission import PART_FILES

#: Numbers beyond these are not changed.
_MAX_NUMBERS = 32
#: Roles of amounts in rotations of the wheels, and the least amount that is more likely in another unit.
_AMOUNT_ROLES = frozenset({"turn", "distance"})
_MIN_LARGE_AMOUNT = 20.0
#: Colours of a floor: every so many pixels are looked at, and colours with a smaller share of them don't count.
_FLOOR_STEP, _MIN_SHARE, _MAX_LEVELS = 8, 0.002, 8
_WHITE = 255.0


@dataclass(frozen=True, slots=True)
class ProgramNumber:
    """A number in a student's program. ``index`` is its place among all of them.

    ``twin`` is the number beside it that changes with it: the other speed of a robot that drives straight on or turns
    on the spot.
    """

    index: int
    file: str
    tree: SourceTree = field(repr=False, compare=False)
    literal: NumberLiteral = field(compare=False)
    role: NumberRole
    lines: frozenset[int]  # its line, and those that use the constant
    twin: NumberLiteral | None = field(default=None, compare=False)

    @property
    def value(self) -> float:
        """The value of the number."""
        return self.literal.value

    @property
    def line(self) -> int:
        """The line of the number, from 1."""
        return self.literal.line

    @property
    def column(self) -> int:
        """The column in the line, from 1."""
        return self.literal.start - self.tree.find_line_start(self.line) + 1

    @property
    def old(self) -> str:
        """The number as it is written."""
        return self.tree.text[self.literal.start : self.literal.end]

    @property
    def is_whole(self) -> bool:
        """Return whether only whole numbers make sense."""
        return self.role in WHOLE_ROLES and float(self.value).is_integer()

    @property
    def is_alone_on_line(self) -> bool:
        """Return whether the line has no other number, apart from the twin."""
        return sum(each.line == self.line for each in self.tree.numbers) == (1 if self.twin is None else 2)

    def format_value(self, value: float) -> str:
        """Return a new value as a student would write it."""
        if self.is_whole:
            return str(round(value))
        text = f"{value:.3g}" if abs(value) < 1000 else f"{value:.0f}"
        return text if float(text) != self.value else f"{value:.5g}"

    def change_text(self, value: float) -> str:
        """Return the text of the program with another value."""
        new = self.format_value(value)
        start, end = self.literal.start, self.literal.end
        if self.twin is not None:
            other = self.format_value(math.copysign(1, self.twin.value * self.value) * value)
            new = f"{new}{self.tree.text[end : self.twin.start]}{other}"
            end = self.twin.end
        return self.tree.apply(Edit(start, end, new))


#: A number and a new value.
Candidate = tuple[ProgramNumber, float]


def collect_numbers(trees: Mapping[str, SourceTree]) -> list[ProgramNumber]:
    """Return the numbers of files, those without an obvious role last. Numbers with their twins come first."""
    numbers: list[ProgramNumber] = []
    for file, tree in trees.items():
        singles = [
            ProgramNumber(0, file, tree, each, find_role(tree, each), find_lines(tree, each)) for each in tree.numbers
        ]
        numbers += [*_pair_speeds(tree, singles), *singles]
    numbers.sort(key=lambda each: each.role in ("index", "number"))
    return [replace(each, index=index) for index, each in enumerate(numbers[:_MAX_NUMBERS])]


def _pair_speeds(tree: SourceTree, numbers: Sequence[ProgramNumber]) -> Iterator[ProgramNumber]:
    """Yield each left speed with the right speed of the same call as its twin, if both are as fast."""
    for left, right in itertools.pairwise(numbers):
        roles = (left.role, right.role)
        if roles != ("left speed", "right speed") or abs(left.value) != abs(right.value) or not left.value:
            continue
        if _find_move(tree, left.literal) is _find_move(tree, right.literal):
            yield replace(left, role="speed", twin=right.literal)


def _find_move(tree: SourceTree, number: NumberLiteral) -> ast.AST | None:
    """Return the statement that a number belongs to."""
    return next((each for each in tree.iterate_ancestors(number.node) if isinstance(each, ast.stmt)), None)


def suggest_scaled_numbers(
    numbers: Sequence[ProgramNumber], scaled_line: tuple[int, float] | None
) -> Iterator[Candidate]:
    """Yield the numbers of a line of the robot program, each scaled by the factor of its motion and by the inverse."""
    line, factor = scaled_line or (0, 1.0)
    for number in numbers:
        if number.file == PART_FILES["program"] and line in number.lines and number.value:
            # A number may also be a divisor.
            yield from ((number, number.value * scale) for scale in (factor, 1 / factor))


def suggest_thresholds(numbers: Sequence[ProgramNumber], floor: Floor) -> Iterator[Candidate]:
    """Yield each threshold halfway between two neighbouring colours of the floor, the nearest first."""
    levels = _list_light_levels(floor)
    middles = [(first + second) / 2 for first, second in itertools.pairwise(levels)]
    for number in (each for each in numbers if each.role == "threshold"):
        scale = 100 / _WHITE if "intensity_pc" in number.tree.text else 1.0
        values = sorted((middle * scale for middle in middles), key=lambda each: abs(each - number.value))
        yield from ((number, value) for value in values)


def _list_light_levels(floor: Floor) -> list[float]:
    """Return the most frequent brightnesses of the floor's colours, 0 to 255, in order."""
    sample = floor.pixels[::_FLOOR_STEP, ::_FLOOR_STEP].reshape(-1)
    levels, counts = np.unique(sample, return_counts=True)
    frequent = sorted(zip(counts, levels, strict=True), reverse=True)[:_MAX_LEVELS]
    return sorted(float(level) for count, level in frequent if count >= _MIN_SHARE * len(sample))


def suggest_rotations(numbers: Sequence[ProgramNumber], robot: Robot) -> Iterator[Candidate]:
    """Yield large amounts in rotations: converted from degrees of the robot or of the wheels, and from mm."""
    for number in numbers:
        if number.role in _AMOUNT_ROLES and abs(number.value) >= _MIN_LARGE_AMOUNT:
            # A turn of the robot takes twice the rotations that its wheels make on the floor.
            per_degree = 2 * robot.wheel_spacing / robot.wheel_diameter if number.role == "turn" else 1.0
            yield number, number.value * per_degree / 360
            yield number, number.value / (math.pi * robot.wheel_diameter)


def suggest_other_speeds(numbers: Sequence[ProgramNumber]) -> Iterator[Candidate]:
    """Yield each speed as fast as another one on the same line."""
    for number, other in itertools.permutations(numbers, 2):
        is_pair = (number.file, number.line) == (other.file, other.line) and "speed" in number.role
        if is_pair and "speed" in other.role and abs(number.value) != abs(other.value):
            yield number, math.copysign(other.value, number.value)
