"""Disguises for copies of Python programs: each takes a source and returns an altered one that does much the same.

``DISGUISES`` maps names to disguises. A magic line at the top stays in place.
"""

from __future__ import annotations

import ast
from collections.abc import Callable, Mapping
from typing import cast


def reformat(source: str) -> str:
    """Return the source with other comments, spaces and empty lines, and without docstrings."""
    lines = ast.unparse(_remove_docstrings(ast.parse(source))).split("\n")
    return "\n".join(f"{line}\n\n{line[: len(line) - len(line.lstrip())]}# now {line.strip()}" for line in lines)


def rename_all(source: str) -> str:
    """Return the source with all its own names replaced, except those that mark the responder."""
    tree = ast.parse(source)
    bound = {node.id for node in ast.walk(tree) if isinstance(node, ast.Name) and isinstance(node.ctx, ast.Store)}
    bound |= {node.arg for node in ast.walk(tree) if isinstance(node, ast.arg)}
    bound |= {node.name for node in ast.walk(tree) if isinstance(node, ast.FunctionDef | ast.ClassDef)}
    new = {name: f"other_{number}" for number, name in enumerate(sorted(bound)) if not name.endswith("responder")}
    return ast.unparse(_Renamer(new).visit(tree))


def change_constants(source: str) -> str:
    """Return the source with every number and text replaced."""
    return ast.unparse(ast.fix_missing_locations(_ConstantChanger().visit(ast.parse(source))))


def reorder_statements(source: str) -> str:
    """Return the source with the statements of every block swapped in pairs, even if it no longer works."""
    tree = ast.parse(source)
    for node in ast.walk(tree):
        for field in ("body", "orelse"):
            block = getattr(node, field, None)
            if isinstance(block, list):
                block[:-1:2], block[1::2] = block[1::2], block[: len(block) - len(block) % 2 : 2]
    return ast.unparse(tree)


def rewrite_expressions(source: str) -> str:
    """Return the source with swapped operands, reversed comparisons, and two-term sums written as ``sum`` of a list."""
    return ast.unparse(ast.fix_missing_locations(_ExpressionRewriter().visit(ast.parse(source))))


def extract_functions(source: str) -> str:
    """Return the source with loop bodies, first halves of functions, and remaining code moved to functions."""
    tree = ast.parse(source)
    definitions = [node for node in tree.body if isinstance(node, ast.Import | ast.ImportFrom | ast.FunctionDef)]
    other_statements = [node for node in tree.body if node not in definitions]
    functions: list[ast.stmt] = []
    for node in [*definitions, *other_statements]:
        if isinstance(node, ast.While | ast.For) or (isinstance(node, ast.FunctionDef) and len(node.body) > 3):
            moved_count = len(node.body) if not isinstance(node, ast.FunctionDef) else len(node.body) // 2
            name = f"step_{len(functions)}"
            functions.append(_build_function(name, node.body[:moved_count]))
            node.body[:moved_count] = ast.parse(f"result = {name}()").body
    main = [_build_function("main", other_statements), *ast.parse("main()").body] if other_statements else []
    return ast.unparse(ast.fix_missing_locations(ast.Module([*functions, *definitions, *main], [])))


def apply_all(source: str) -> str:
    """Return the source with all disguises except ``respelled``."""
    return extract_functions(reorder_statements(change_constants(rename_all(reformat(source)))))


def _keep_magic(copyist: Callable[[str], str]) -> Callable[[str], str]:
    def copy(source: str) -> str:
        if not source.startswith("%"):
            return copyist(source)
        magic, _, body = source.partition("\n")
        return f"{magic}\n{copyist(body)}"

    return copy


DISGUISES: Mapping[str, Callable[[str], str]] = {
    copyist.__name__.replace("_", " "): _keep_magic(copyist)
    for copyist in (
        reformat,
        rename_all,
        change_constants,
        reorder_statements,
        rewrite_expressions,
        extract_functions,
        apply_all,
    )
}


class _ExpressionRewriter(ast.NodeTransformer):
    _TURNED: Mapping[type[ast.cmpop], type[ast.cmpop]] = {
        ast.Lt: ast.Gt,
        ast.Gt: ast.Lt,
        ast.LtE: ast.GtE,
        ast.GtE: ast.LtE,
        ast.Eq: ast.Eq,
        ast.NotEq: ast.NotEq,
    }

    def visit_BinOp(self, node: ast.BinOp) -> ast.AST:
        self.generic_visit(node)
        operands = (node.left, node.right)
        if any(isinstance(each, ast.JoinedStr | ast.Constant) and not _is_number(each) for each in operands):
            return node
        if isinstance(node.op, ast.Mult):
            return ast.BinOp(node.right, node.op, node.left)
        if isinstance(node.op, ast.Add):
            return ast.Call(ast.Name("sum", ast.Load()), [ast.List([node.right, node.left], ast.Load())], [])
        return node

    def visit_Compare(self, node: ast.Compare) -> ast.AST:
        self.generic_visit(node)
        mirrored_operator = self._TURNED.get(type(node.ops[0]))
        if mirrored_operator is None or len(node.ops) > 1:
            return node
        return ast.Compare(node.comparators[0], [mirrored_operator()], [node.left])


def _is_number(node: ast.expr) -> bool:
    return isinstance(node, ast.Constant) and isinstance(node.value, int | float)


class _Renamer(ast.NodeTransformer):
    def __init__(self, new: Mapping[str, str]) -> None:
        self._new = new

    def generic_visit(self, node: ast.AST) -> ast.AST:
        for field in ("id", "arg", "name"):
            name = getattr(node, field, None)
            if isinstance(name, str) and not isinstance(node, ast.keyword | ast.alias):
                setattr(node, field, self._new.get(name, name))
        if isinstance(node, ast.Global | ast.Nonlocal):
            node.names = [self._new.get(name, name) for name in node.names]
        return super().generic_visit(node)


class _ConstantChanger(ast.NodeTransformer):
    def visit_Constant(self, node: ast.Constant) -> ast.AST:
        if isinstance(node.value, str):
            return ast.Constant(f"{node.value}, changed")
        if isinstance(node.value, int | float) and not isinstance(node.value, bool):
            return ast.Constant(2 * node.value + 1)
        return node

    def visit_JoinedStr(self, node: ast.JoinedStr) -> ast.AST:
        return node


def _remove_docstrings(tree: ast.Module) -> ast.Module:
    for node in ast.walk(tree):
        body = getattr(node, "body", None)
        if isinstance(body, list) and len(body) > 1 and isinstance(body[0], ast.Expr):
            body[:1] = [] if isinstance(body[0].value, ast.Constant) else body[:1]
    return tree


def _build_function(name: str, body: list[ast.stmt]) -> ast.FunctionDef:
    function = cast(ast.FunctionDef, ast.parse(f"def {name}():\n    pass").body[0])
    function.body = body
    return function
