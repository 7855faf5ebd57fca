"""The roles of the numbers in a program, and sentences that say in which direction a number is wrong.

The sentences for students name the line and the direction, not the number.
"""

from __future__ import annotations

import ast
from collections.abc import Mapping
from types import MappingProxyType
from typing import Literal

from service.language import translatable
from service.mutation.operators import is_index, is_range_argument
from service.mutation.source_tree import NumberLiteral, SourceTree, get_called_name
from sim.sentences import Sentence

NumberRole = Literal[
    "turn", "distance", "time", "speed", "left speed", "right speed", "steering", "wait", "threshold", "loop", "index",
    "range", "number",
]  # fmt: skip
Direction = Literal["larger", "smaller", "other sign"]

_AMOUNTS: Mapping[str, NumberRole] = MappingProxyType(
    {"on_for_rotations": "distance", "on_for_degrees": "distance", "on_for_seconds": "time"}
)
_MOVES = frozenset({*_AMOUNTS, "on"})
#: Parts of the names of objects that steer.
_STEERING_NAMES = ("turn", "steer")
#: Roles of numbers that have no fractions.
WHOLE_ROLES: frozenset[NumberRole] = frozenset({"loop", "index", "range"})
_NUMBER_SENTENCES = (
    translatable("The number at %(place)s is too small."),
    translatable("The number at %(place)s is too large."),
    translatable("The number at %(place)s has the wrong sign."),
)
#: For each role: the sentence if the number must be larger, if it must be smaller, and if it needs the other sign.
_SENTENCES: Mapping[NumberRole, tuple[str, str, str]] = MappingProxyType(
    {
        "turn": (
            translatable("The turn at %(place)s is too short."),
            translatable("The turn at %(place)s is too long."),
            translatable("The turn at %(place)s is in the wrong direction."),
        ),
        "distance": (
            translatable("The distance at %(place)s is too short."),
            translatable("The distance at %(place)s is too long."),
            translatable("The move at %(place)s is in the wrong direction."),
        ),
        "time": (
            translatable("The move at %(place)s takes too little time."),
            translatable("The move at %(place)s takes too much time."),
            translatable("The time at %(place)s has the wrong sign."),
        ),
        "speed": (
            translatable("The speed at %(place)s is too low."),
            translatable("The speed at %(place)s is too high."),
            translatable("The speed at %(place)s has the wrong sign."),
        ),
        # Changing either speed can have the same effect, so the sentences compare them.
        "left speed": (
            translatable("The left speed at %(place)s is too low, compared with the right one."),
            translatable("The left speed at %(place)s is too high, compared with the right one."),
            translatable("The left speed at %(place)s has the wrong sign, compared with the right one."),
        ),
        "right speed": (
            translatable("The left speed at %(place)s is too high, compared with the right one."),
            translatable("The left speed at %(place)s is too low, compared with the right one."),
            translatable("The left speed at %(place)s has the wrong sign, compared with the right one."),
        ),
        "steering": (
            translatable("The steering at %(place)s is too weak."),
            translatable("The steering at %(place)s is too strong."),
            translatable("The steering at %(place)s is to the wrong side."),
        ),
        "wait": (
            translatable("The wait at %(place)s is too short."),
            translatable("The wait at %(place)s is too long."),
            translatable("The wait at %(place)s has the wrong sign."),
        ),
        "threshold": (
            translatable("The threshold at %(place)s is too low."),
            translatable("The threshold at %(place)s is too high."),
            translatable("The threshold at %(place)s has the wrong sign."),
        ),
        "loop": (
            translatable("The limit of the loop at %(place)s is too low."),
            translatable("The limit of the loop at %(place)s is too high."),
            translatable("The limit of the loop at %(place)s has the wrong sign."),
        ),
        "index": (
            translatable("The index at %(place)s is too low."),
            translatable("The index at %(place)s is too high."),
            translatable("The index at %(place)s counts from the wrong end."),
        ),
        "range": _NUMBER_SENTENCES,
        "number": _NUMBER_SENTENCES,
    }
)


def find_role(tree: SourceTree, number: NumberLiteral) -> NumberRole:
    """Return the role of a number. The number of a named constant has the role of the name's first use."""
    role = _find_role_of_node(tree, number.node)
    if role != "number":
        return role
    roles = [_find_role_of_node(tree, each) for each in _list_uses(tree, number)]
    if {"left speed", "right speed"} <= set(roles):
        return "speed"
    return next((each for each in roles if each != "number"), "number")


def find_lines(tree: SourceTree, number: NumberLiteral) -> frozenset[int]:
    """Return the line of a number. For a named constant, add the lines where the name is used."""
    return frozenset({number.line, *(each.lineno for each in _list_uses(tree, number))})


def _list_uses(tree: SourceTree, number: NumberLiteral) -> list[ast.Name]:
    """Return the uses of the names to which a number is assigned; empty if it is not assigned."""
    parent = tree.find_parent(number.node)
    targets = parent.targets if isinstance(parent, ast.Assign) else []
    names = {each.id for each in targets if isinstance(each, ast.Name)}
    uses = (each for each in tree.nodes if isinstance(each, ast.Name) and each.id in names)
    return [each for each in uses if isinstance(each.ctx, ast.Load)]


def describe_direction(role: NumberRole, direction: Direction, place: str) -> Sentence:
    """Return the sentence for students: the place and the direction, without the number."""
    larger, smaller, other_sign = _SENTENCES[role]
    template = {"larger": larger, "smaller": smaller, "other sign": other_sign}[direction]
    return Sentence(template, place=place)


def find_direction(old: float, new: float, role: NumberRole) -> Direction:
    """Return the direction of a change. Speeds, distances and the like are compared without their signs."""
    if old * new < 0:
        return "other sign"
    is_signed = role in ("threshold", "index", "loop", "number")
    is_larger = new > old if is_signed else abs(new) > abs(old)
    return "larger" if is_larger else "smaller"


def _find_role_of_node(tree: SourceTree, node: ast.expr) -> NumberRole:
    if is_index(tree, node):
        return "index"
    parent = tree.find_parent(node)
    if isinstance(parent, ast.Call) and is_range_argument(tree, node):
        # The first of several arguments is the start, and the third is the step.
        return "loop" if node is parent.args[min(1, len(parent.args) - 1)] else "range"
    if isinstance(parent, ast.Compare):
        return "threshold"
    child: ast.AST = node
    for parent in tree.iterate_ancestors(node):
        if isinstance(parent, ast.Call):
            role = _find_role_of_argument(parent, child)
            outer_call = tree.find_parent(parent)
            if role == "speed" and isinstance(outer_call, ast.Call):  # the argument of SpeedPercent
                return _find_role_of_argument(outer_call, parent)
            return role
        # The role says what a larger number does, so no divisor and nothing that is subtracted has one.
        is_direct = isinstance(parent, ast.UnaryOp | ast.keyword) or (
            isinstance(parent, ast.BinOp)
            and (isinstance(parent.op, ast.Add | ast.Mult) or (parent.left is child and not _is_power(parent)))
        )
        if not is_direct:
            return "number"
        child = parent
    return "number"


def _is_power(node: ast.BinOp) -> bool:
    return isinstance(node.op, ast.Pow | ast.Mod)


def _find_role_of_argument(call: ast.Call, argument: ast.AST) -> NumberRole:
    name = get_called_name(call)
    if name == "sleep":
        return "wait"
    if name.startswith("Speed"):
        return "speed"
    if name not in _MOVES or not isinstance(call.func, ast.Attribute):
        return "number"
    is_steered = any(each in ast.unparse(call.func.value).lower() for each in _STEERING_NAMES)
    is_turn = is_steered or _has_opposite_speeds(call)
    keyword = next((each.arg for each in call.keywords if each is argument or each.value is argument), None)
    position = next((index for index, each in enumerate(call.args) if each is argument), None)
    if position == 0 and is_steered:
        return "steering"
    if name in _AMOUNTS and (position == 2 or keyword in ("rotations", "degrees", "seconds")):
        return "turn" if is_turn else _AMOUNTS[name]
    if not is_steered and len(call.args) > 1 and position in (0, 1):
        return "left speed" if position == 0 else "right speed"
    return "speed"


def _has_opposite_speeds(call: ast.Call) -> bool:
    """Return whether one of the two speeds has a minus sign, and the other one has none."""
    minus_signs = [any(isinstance(node, ast.USub) for node in ast.walk(each)) for each in call.args[:2]]
    return len(set(minus_signs)) == 2
