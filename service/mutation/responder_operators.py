"""Mutation operators for responders and agents: answers, labels, keys, types and remembered values."""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator
from itertools import pairwise

from service.mutation.operators import declare_operator, list_texts
from service.mutation.source_tree import Edit, SourceTree, get_called_name, get_text
from submissions.submission import Part

_RESPONDER: tuple[Part, ...] = ("responder",)
_TYPES = {"int": "str", "float": "str", "str": "repr", "dumps": "dict", "tuple": "str", "list": "str", "bool": "str"}
_TEXT_LITERAL = re.compile(r"""[uUrR]?("{3}|'{3}|["'])(?:.*)\1\Z""", re.DOTALL)
#: Methods that change the object they belong to.
_CHANGES = frozenset({"append", "extend", "insert", "add", "update", "pop", "popleft", "remove", "clear", "setdefault"})
_FUNCTIONS = (ast.FunctionDef, ast.AsyncFunctionDef)


@declare_operator("label swapped")
def swap_labels(tree: SourceTree) -> Iterator[Edit]:
    """Yield each two texts that follow each other in a list, a dictionary or a choice exchanged."""
    for node in tree.nodes:
        texts = list_texts(tree, node)
        if isinstance(node, ast.IfExp) and get_text(node.body) is not None and get_text(node.orelse) is not None:
            yield tree.exchange(node.body, node.orelse)
        pairs = pairwise(texts)
        yield from (tree.exchange(*pair) for pair in pairs if get_text(pair[0]) != get_text(pair[1]))


@declare_operator("none", _RESPONDER)
def return_none(tree: SourceTree) -> Iterator[Edit]:
    """Yield each ``return`` without its value."""
    for value in _iterate_returned_values(tree):
        yield tree.replace(value, "None")


@declare_operator("wrong key")
def change_keys(tree: SourceTree) -> Iterator[Edit]:
    """Yield each key of a dictionary with one more letter."""
    for node in tree.nodes:
        keys = list(node.keys) if isinstance(node, ast.Dict) else []
        if isinstance(node, ast.Subscript):
            keys = [node.slice]
        elif isinstance(node, ast.Call) and get_called_name(node) in ("get", "setdefault"):
            keys = [*node.args[:1]]
        for key in keys:
            if key is None or not get_text(key):
                continue
            literal = tree.cut(key)
            match = _TEXT_LITERAL.match(literal)
            if match is not None:
                yield tree.replace(key, f"{literal.removesuffix(match[1])}s{match[1]}")


@declare_operator("wrong type", _RESPONDER)
def change_types(tree: SourceTree) -> Iterator[Edit]:
    """Yield each returned value in a list, and each conversion to another type."""
    for value in _iterate_returned_values(tree):
        yield tree.replace(value, f"[{tree.cut(value)}]")
    for node in tree.nodes:
        if isinstance(node, ast.Call) and get_called_name(node) in _TYPES and len(node.args) == 1:
            yield tree.replace(node.func, _TYPES[get_called_name(node)])


@declare_operator("state lost", _RESPONDER)
def lose_state(tree: SourceTree) -> Iterator[Edit]:
    """Yield each statement of a function that changes a value outside it, replaced by ``pass``."""
    for function in tree.nodes:
        if not isinstance(function, _FUNCTIONS):
            continue
        outer_names = {name for node in ast.walk(function) if isinstance(node, ast.Global) for name in node.names}
        local_names = _collect_local_names(function) - outer_names
        for node in ast.walk(function):
            if isinstance(node, ast.Expr | ast.Assign | ast.AugAssign) and _changes_outer_value(
                node, outer_names, local_names
            ):
                yield tree.replace(node, "pass")


def _iterate_returned_values(tree: SourceTree) -> Iterator[ast.expr]:
    for node in tree.nodes:
        value = node.value if isinstance(node, ast.Return) else None
        if value is not None and not (isinstance(value, ast.Constant) and value.value is None):
            yield value


def _collect_local_names(function: ast.FunctionDef | ast.AsyncFunctionDef) -> set[str]:
    arguments = function.args
    names = {each.arg for each in (*arguments.posonlyargs, *arguments.args, *arguments.kwonlyargs)} - {"self"}
    stored_names = (node for node in ast.walk(function) if isinstance(node, ast.Name))
    return names | {node.id for node in stored_names if isinstance(node.ctx, ast.Store)}


def _changes_outer_value(node: ast.Expr | ast.Assign | ast.AugAssign, outer: set[str], local: set[str]) -> bool:
    if isinstance(node, ast.Expr):
        function = node.value.func if isinstance(node.value, ast.Call) else None
        if not isinstance(function, ast.Attribute) or function.attr not in _CHANGES:
            return False
        return _find_root(function.value) not in {*local, ""}
    targets = node.targets if isinstance(node, ast.Assign) else [node.target]
    for target in targets:
        root = _find_root(target)
        is_name = isinstance(target, ast.Name)
        if root and (root in outer if is_name else root not in local):
            return True
    return False


def _find_root(node: ast.expr) -> str:
    """Return the name that an attribute or an index belongs to; empty if it belongs to none."""
    while isinstance(node, ast.Attribute | ast.Subscript):
        node = node.value
    return node.id if isinstance(node, ast.Name) else ""
