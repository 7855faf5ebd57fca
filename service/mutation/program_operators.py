"""Mutation operators for robot programs: ports, waits and units."""

from __future__ import annotations

import ast
from collections.abc import Iterator

from service.mutation.operators import declare_operator, is_index, is_wait
from service.mutation.source_tree import Edit, SourceTree, get_called_name, get_number, get_text

_PORTS = {
    "OUTPUT_B": "OUTPUT_C",
    "OUTPUT_A": "OUTPUT_D",
    "INPUT_2": "INPUT_3",
    "INPUT_1": "INPUT_4",
    "colorLeft": "colorRight",
    "outB": "outC",
    "in2": "in3",
    "left": "right",
}
_OTHER_PORTS = _PORTS | {other: port for port, other in _PORTS.items()}
#: Names after a point, and the name for another unit.
_UNITS = {
    "on_for_rotations": "on_for_degrees",
    "on_for_degrees": "on_for_rotations",
    "on_for_seconds": "on_for_rotations",
    "reflected_light_intensity_pc": "reflected_light_intensity",
    "reflected_light_intensity": "reflected_light_intensity_pc",
    "distance_centimeters": "distance_inches",
    "distance_inches": "distance_centimeters",
    "radians": "degrees",
    "degrees": "radians",
}
_MOVES = frozenset({"on", "on_for_rotations", "on_for_degrees", "on_for_seconds"})


@declare_operator("port", ("program",))
def exchange_ports(tree: SourceTree) -> Iterator[Edit]:
    """Yield each port and each side as the other one, and the first two arguments of moves exchanged."""
    for node in tree.nodes:
        name = node.id if isinstance(node, ast.Name) and isinstance(node.ctx, ast.Load) else None
        if isinstance(node, ast.Name) and name in _OTHER_PORTS:
            yield tree.replace(node, _OTHER_PORTS[name])
        elif isinstance(node, ast.Constant) and (text := get_text(node)) in _OTHER_PORTS and _is_port(tree, node):
            yield tree.replace(node, repr(_OTHER_PORTS[str(text)]))
        elif isinstance(node, ast.Call) and get_called_name(node) in _MOVES and len(node.args) > 1:
            first, second = node.args[:2]
            is_plain = not any(isinstance(each, ast.Starred) for each in (first, second))
            if is_plain and tree.cut(first) != tree.cut(second):
                yield tree.exchange(first, second)


@declare_operator("wait removed", ("program",))
def remove_waits(tree: SourceTree) -> Iterator[Edit]:
    """Yield each statement that only waits replaced by ``pass``."""
    for node in tree.nodes:
        if isinstance(node, ast.Expr) and is_wait(node):
            yield tree.replace(node, "pass")


@declare_operator("wrong unit", ("program",))
def change_units(tree: SourceTree) -> Iterator[Edit]:
    """Yield each method and reading with another unit, and each wait in milliseconds."""
    for node in tree.nodes:
        if isinstance(node, ast.Attribute) and node.attr in _UNITS:
            _, end = tree.locate(node)
            yield Edit(end - len(node.attr), end, _UNITS[node.attr])
        elif isinstance(node, ast.Call) and get_called_name(node) == "sleep" and len(node.args) == 1:
            seconds = get_number(node.args[0])
            if seconds:
                yield tree.replace(node.args[0], f"{seconds * 1000:g}")


def _is_port(tree: SourceTree, node: ast.expr) -> bool:
    """Return whether a text selects a port or a side: it is an index, or an argument of a class."""
    parent = tree.find_parent(node)
    return is_index(tree, node) or (isinstance(parent, ast.Call) and get_called_name(parent)[:1].isupper())
