"""Detection of call arguments that may be texts to look up or run: method names, and files with pickled objects.

It uses only the syntax. ``syntax_walker.py`` decides which arguments are doubtful.
"""

from __future__ import annotations

import ast
from collections.abc import Iterator, Set

from .node_properties import read_constant_text
from .vocabulary import MAY_TAKE_NAME, MAY_UNPICKLE, NAME_IN_ANY_KEYWORD, NAME_KEYWORDS

_TEXT_FUNCTIONS = frozenset({"str", "chr", "repr", "ascii", "join", "decode"})


def list_name_arguments(call: ast.Call, calls: Set[str]) -> Iterator[tuple[str, ast.expr]]:
    """Yield each argument that may be a name to look up, with a description. ``calls`` are the function's names.

    Elements of lists, tuples and dictionaries are separate arguments.
    """
    for name in sorted(calls & MAY_TAKE_NAME.keys()):
        first_starred = next((at for at, each in enumerate(call.args) if isinstance(each, ast.Starred)), len(call.args))
        for index, argument in enumerate(call.args):
            if index in MAY_TAKE_NAME[name] or index >= first_starred:
                yield from ((name, part) for part in _list_parts(argument))
        for keyword in call.keywords:
            if keyword.arg is None or (name in NAME_IN_ANY_KEYWORD and keyword.arg not in NAME_KEYWORDS):
                yield from ((name, part) for part in _list_parts(keyword.value))
    for keyword in call.keywords:
        if keyword.arg in NAME_KEYWORDS:
            yield from ((f"{keyword.arg}=", part) for part in _list_parts(keyword.value))


def _list_parts(node: ast.expr) -> Iterator[ast.expr]:
    match node:
        case ast.List(elts=parts) | ast.Tuple(elts=parts) | ast.Set(elts=parts) | ast.Dict(values=parts):
            for part in parts:
                yield from _list_parts(part)
        case _:
            yield node


def may_unpickle(call: ast.Call, calls: Set[str]) -> bool:
    """Return whether a call lets NumPy load pickled objects, or may do so."""
    values = [keyword.value for keyword in call.keywords if keyword.arg == "allow_pickle"]
    for name in calls & MAY_UNPICKLE.keys():
        values += call.args[MAY_UNPICKLE[name] :]
        values += [each for each in call.args if isinstance(each, ast.Starred)]
        values += [keyword.value for keyword in call.keywords if keyword.arg is None]
    return not all(isinstance(value, ast.Constant) and not value.value for value in values)


def is_text_expression(node: ast.AST) -> bool:
    """Return whether an expression is a text, as far as its syntax shows that."""
    if read_constant_text(node) is not None:
        return True
    match node:
        case ast.JoinedStr():
            return True
        case ast.BinOp(left=left, op=ast.Add() | ast.Mult() | ast.Mod(), right=right):
            return is_text_expression(left) or is_text_expression(right)
        case ast.IfExp(body=body, orelse=orelse):
            return is_text_expression(body) or is_text_expression(orelse)
        case ast.BoolOp(values=parts):
            return any(map(is_text_expression, parts))
        case ast.NamedExpr(value=value):
            return is_text_expression(value)
        case ast.Subscript(value=value):
            return any(map(is_text_expression, _list_parts(value)))
        case ast.Call(func=ast.Name(id=name)):
            return name in _TEXT_FUNCTIONS
        case ast.Call(func=ast.Attribute(value=value, attr=name)):
            return name in _TEXT_FUNCTIONS or is_text_expression(value)
    return False
