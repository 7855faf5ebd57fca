"""Detection of call arguments that may be texts to look up or run: method names, and files with pickled objects.

It uses only the syntax. ``walk.py`` decides which arguments are doubtful.
"""

from __future__ import annotations

import ast
from collections.abc import Iterator, Set

from .names import text_of
from .vocabulary import MAY_TAKE_NAME, MAY_UNPICKLE, NAME_IN_ANY_KEYWORD, NAME_KEYWORDS

_MAKES_TEXT = frozenset({"str", "chr", "repr", "ascii", "join", "decode"})


def name_arguments(call: ast.Call, calls: Set[str]) -> Iterator[tuple[str, ast.expr]]:
    """Yield each argument that may be a name to look up, with a description. ``calls`` are the function's names.

    Elements of lists, tuples and dictionaries are separate arguments.
    """
    for name in sorted(calls & MAY_TAKE_NAME.keys()):
        starred = next((at for at, each in enumerate(call.args) if isinstance(each, ast.Starred)), len(call.args))
        for at, argument in enumerate(call.args):
            if at in MAY_TAKE_NAME[name] or at >= starred:
                yield from ((name, part) for part in _parts(argument))
        for keyword in call.keywords:
            if keyword.arg is None or (name in NAME_IN_ANY_KEYWORD and keyword.arg not in NAME_KEYWORDS):
                yield from ((name, part) for part in _parts(keyword.value))
    for keyword in call.keywords:
        if keyword.arg in NAME_KEYWORDS:
            yield from ((f"{keyword.arg}=", part) for part in _parts(keyword.value))


def _parts(node: ast.expr) -> Iterator[ast.expr]:
    match node:
        case ast.List(elts=parts) | ast.Tuple(elts=parts) | ast.Set(elts=parts) | ast.Dict(values=parts):
            for part in parts:
                yield from _parts(part)
        case _:
            yield node


def may_unpickle(call: ast.Call, calls: Set[str]) -> bool:
    """Return whether a call lets NumPy load pickled objects, or may do so."""
    given = [keyword.value for keyword in call.keywords if keyword.arg == "allow_pickle"]
    for name in calls & MAY_UNPICKLE.keys():
        given += call.args[MAY_UNPICKLE[name] :]
        given += [each for each in call.args if isinstance(each, ast.Starred)]
        given += [keyword.value for keyword in call.keywords if keyword.arg is None]
    return not all(isinstance(value, ast.Constant) and not value.value for value in given)


def makes_text(node: ast.AST) -> bool:
    """Return whether an expression is a text, as far as its syntax shows that."""
    if text_of(node) is not None:
        return True
    match node:
        case ast.JoinedStr():
            return True
        case ast.BinOp(left=left, op=ast.Add() | ast.Mult() | ast.Mod(), right=right):
            return makes_text(left) or makes_text(right)
        case ast.IfExp(body=body, orelse=orelse):
            return makes_text(body) or makes_text(orelse)
        case ast.BoolOp(values=parts):
            return any(map(makes_text, parts))
        case ast.NamedExpr(value=value):
            return makes_text(value)
        case ast.Subscript(value=value):
            return any(map(makes_text, _parts(value)))
        case ast.Call(func=ast.Name(id=name)):
            return name in _MAKES_TEXT
        case ast.Call(func=ast.Attribute(value=value, attr=name)):
            return name in _MAKES_TEXT or makes_text(value)
    return False
